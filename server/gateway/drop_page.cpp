#include "server/gateway/drop_page.h"

#include <string>

#include "server/report/page_parts.h"
#include "server/report/page_policy.h"

namespace trammel {
namespace {

/// Beside the style of all pages.
constexpr const char* kStyle = R"page(
label { display: inline-block; margin: 0 20px 12px 0; color: var(--soft); }
input { font: inherit; max-width: 100%; display: block; }
#drop { border: 2px dashed var(--nominal); text-align: center; padding: 36px 12px; }
#drop input { margin: 0 auto; }
#drop.over { background: #eef4ff; }
#state { white-space: pre-line; }
#state.bad, tr.left td { color: var(--doubtful); }
#links a { margin-right: 20px; }
)page";

constexpr const char* kBody = R"page(<main>
<h1>Correct a program</h1>
<p class="subtitle">It comes back byte for byte, with the corrected numbers alone changed.</p>
<form id="about"><label>Cell <input id="cell" required></label>
<label>Tool <input id="tool" placeholder="as the program says"></label>
<label>Token <input id="token" type="password" placeholder="if the server asks"
 autocomplete="off"></label>
<label>Frames the files leave open (CSV) <input id="frames" type="file" accept=".csv"></label></form>
<section id="drop"><p>Drop the files of one program here, or choose them:</p>
<input id="files" type="file" multiple></section>
<p id="state" role="status"></p>
<p id="links"></p>
<div id="result"></div></main>
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
  const a = document.createElement('a');
  a.textContent = name; a.download = name.split('/').pop();
  a.href = URL.createObjectURL(new Blob([bytes], {type}));
  at('links').append(a, ' ');
}
const kNames = ['line', 'target', 'status', 'before, mm', 'after, mm', 'why'];
function row(part, cells, kind) {
  const line = document.createElement('tr');
  cells.forEach((cell, i) => {
    const one = document.createElement(kind);
    one.textContent = cell; one.dataset.name = kNames[i]; line.append(one);
  });
  part.append(line);
  return line;
}
function show(done) {
  for (const file of done.files) link(file.name, unpacked(file.base64), 'application/octet-stream');
  link('receipt.csv', done.receipt_csv, 'text/csv');
  link('receipt.json', JSON.stringify(done.receipt, null, 2), 'application/json');
  const table = document.createElement('table'), section = document.createElement('section');
  table.className = 'stacks';
  row(table.createTHead(), kNames, 'th');
  const body = table.createTBody();
  const shown = value => typeof value === 'number' ? value.toFixed(3) : '';
  const shown_first = done.receipt.targets.slice(0, 2000);
  for (const target of shown_first) {
    const line = row(body, [target.line, target.name, target.status, shown(target.error_before_mm),
                            shown(target.error_after_mm), target.message], 'td');
    if (target.status !== 'ok') line.className = 'left';
  }
  section.append(table); at('result').append(section);
  const rest = done.receipt.targets.length - shown_first.length;
  tell(done.summary + (rest > 0 ? 'The table shows the first 2000 targets; the receipt has all.\n' : '') +
       'Model ' + done.model + '.');
}
async function correct(files) {
  at('result').textContent = at('links').textContent = '';
  if (!at('cell').value) return tell('Name the cell first.', true);
  tell('Correcting ...');
  const body = {files: []};
  if (at('tool').value) body.tool = at('tool').value;
  if (at('frames').files.length) body.frames = await at('frames').files[0].text();
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
</script>)page";

std::string page() {
  return std::string(
             "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
             "<title>Correct a program</title>"
             "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">"
             "<style>") +
         std::string(page_style()) + kStyle + "</style></head><body>" + kBody + "</body></html>\n";
}

}  // namespace

HttpReply drop_page() {
  static const std::string kPage = page();
  static const std::string kPolicy = content_policy(inserts_of(kPage)) + "; connect-src 'self'";
  return {200, "text/html; charset=utf-8", kPage, {{"Content-Security-Policy", kPolicy}}};
}

}  // namespace trammel
