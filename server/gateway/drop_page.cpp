#include "server/gateway/drop_page.h"

#include <string>

#include "server/report/page_policy.h"

namespace trammel {
namespace {

constexpr const char* kPage = R"page(<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>Correct a program</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<style>
body { font: 16px/1.5 sans-serif; margin: 2em auto; max-width: 60em; padding: 0 1em; }
label { display: inline-block; margin: 0 1em 1em 0; }
#drop { border: 2px dashed #888; border-radius: 8px; padding: 3em; text-align: center; }
#drop.over { background: #eef4ff; }
table { border-collapse: collapse; } td, th { padding: 0.2em 0.8em; text-align: left; }
.bad { color: #a00; }
</style></head><body>
<h1>Correct a program</h1>
<form id="about"><label>Cell <input id="cell" required></label>
<label>Tool <input id="tool" placeholder="as the program says"></label>
<label>Token <input id="token" type="password" placeholder="if the server asks for one"
 autocomplete="off"></label></form>
<div id="drop"><p>Drop the files of one program here, or choose them:</p>
<input id="files" type="file" multiple></div>
<p id="state" role="status"></p>
<div id="result"></div>
<script>
'use strict';
const at = id => document.getElementById(id);
function tell(text, bad) {
  at('state').textContent = text;
  at('state').className = bad ? 'bad' : '';
}
at('cell').value = new URLSearchParams(location.search).get('cell') || '';
function packed(bytes) {
  let text = '';
  for (let i = 0; i < bytes.length; i += 32768)
    text += String.fromCharCode.apply(null, bytes.subarray(i, i + 32768));
  return btoa(text);
}
const unpacked = text => Uint8Array.from(atob(text), letter => letter.charCodeAt(0));
function link(name, bytes, type) {
  const line = document.createElement('p'), a = document.createElement('a');
  a.textContent = name; a.download = name.split('/').pop();
  a.href = URL.createObjectURL(new Blob([bytes], {type}));
  line.append(a); at('result').append(line);
}
function row(table, cells, kind) {
  const line = document.createElement('tr');
  for (const cell of cells) {
    const one = document.createElement(kind); one.textContent = cell; line.append(one);
  }
  table.append(line);
}
function show(done) {
  for (const file of done.files) link(file.name, unpacked(file.base64), 'application/octet-stream');
  link('receipt.csv', done.receipt_csv, 'text/csv');
  link('receipt.json', JSON.stringify(done.receipt, null, 2), 'application/json');
  const table = document.createElement('table');
  row(table, ['line', 'target', 'status', 'before mm', 'after mm', 'why'], 'th');
  const shown = value => typeof value === 'number' ? value.toFixed(3) : '';
  for (const target of done.receipt.targets.slice(0, 2000))
    row(table, [target.line, target.name, target.status, shown(target.error_before_mm),
                shown(target.error_after_mm), target.message], 'td');
  at('result').append(table);
  tell(done.summary + ' Model ' + done.model + '.');
}
async function correct(files) {
  at('result').textContent = '';
  if (!at('cell').value) return tell('Name the cell first.', true);
  tell('Correcting ...');
  const body = {files: []};
  if (at('tool').value) body.tool = at('tool').value;
  for (const file of files)
    body.files.push({name: file.name, base64: packed(new Uint8Array(await file.arrayBuffer()))});
  const headers = {'Content-Type': 'application/json'};
  if (at('token').value) headers.Authorization = 'Bearer ' + at('token').value;
  try {
    const reply = await fetch('/api/v1/cells/' + encodeURIComponent(at('cell').value) + '/programs',
                              {method: 'POST', headers, body: JSON.stringify(body)});
    const done = await reply.json();
    if (reply.ok) return show(done);
    tell(done.error.sentence || done.error.message, true);
  } catch (failed) {
    tell('The server did not answer: ' + failed.message, true);
  }
}
at('about').onsubmit = event => event.preventDefault();
at('files').onchange = () => correct(at('files').files);
at('drop').ondragover = event => { event.preventDefault(); at('drop').className = 'over'; };
at('drop').ondragleave = () => { at('drop').className = ''; };
at('drop').ondrop = event => {
  event.preventDefault(); at('drop').className = ''; correct(event.dataTransfer.files);
};
</script></body></html>
)page";

}  // namespace

HttpReply drop_page() {
  static const std::string kPolicy = content_policy(inserts_of(kPage)) + "; connect-src 'self'";
  return {200, "text/html; charset=utf-8", kPage, {{"Content-Security-Policy", kPolicy}}};
}

}  // namespace trammel
