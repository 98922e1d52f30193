#include "server/report/page_policy.h"

#include <fmt/format.h>
#include <openssl/evp.h>

#include <array>
#include <map>

#include "server/report/embedded.h"
#include "server/report/html.h"

namespace trammel {
namespace {

/// The contents of all elements with the tag `<name>`, without attributes.
std::vector<std::string> texts_of(std::string_view page, std::string_view name) {
  const std::string open = fmt::format("<{}>", name), close = fmt::format("</{}>", name);
  std::vector<std::string> texts;
  for (std::size_t at = page.find(open); at != std::string_view::npos; at = page.find(open, at)) {
    at += open.size();
    const std::size_t end = page.find(close, at);
    if (end == std::string_view::npos) break;
    texts.emplace_back(page.substr(at, end - at));
    at = end;
  }
  return texts;
}

/// The text for `{{name}}`, for texts that are equal on all pages.
std::string shared_text(std::string_view text) {
  if (text == "{{chart_js}}") return std::string(embedded::chart_js);
  if (text == "{{view3d_js}}") return std::string(embedded::view3d_js);
  if (text == "{{sort_tables_js}}") return std::string(embedded::sort_tables_js);
  if (text == "{{page_css}}") return std::string(embedded::page_css);
  return std::string(text);
}

void append(PageInserts& all, const PageInserts& more) {
  all.scripts.insert(all.scripts.end(), more.scripts.begin(), more.scripts.end());
  all.styles.insert(all.styles.end(), more.styles.begin(), more.styles.end());
}

/// SHA-256 in base64, as the policy spells it.
std::string source_of(const std::string& text) {
  std::array<unsigned char, 32> hash{};
  EVP_Digest(text.data(), text.size(), hash.data(), nullptr, EVP_sha256(), nullptr);
  std::array<unsigned char, 48> base64{};
  const int length = EVP_EncodeBlock(base64.data(), hash.data(), static_cast<int>(hash.size()));
  return fmt::format("'sha256-{}'", std::string_view(reinterpret_cast<const char*>(base64.data()),
                                                     static_cast<std::size_t>(length)));
}

std::string sources_of(const std::vector<std::string>& texts) {
  std::string sources;
  for (const std::string& text : texts) sources += (sources.empty() ? "" : " ") + source_of(text);
  return sources.empty() ? "'none'" : sources;
}

}  // namespace

PageInserts inserts_of(std::string_view page) {
  return {texts_of(page, "script"), texts_of(page, "style")};
}

PageInserts inserts_of_our_pages() {
  PageInserts all;
  for (const std::string_view page :
       {embedded::model_page_html, embedded::diagnosis_page_html, embedded::history_page_html}) {
    PageInserts inserts = inserts_of(page);
    for (std::string& script : inserts.scripts) script = shared_text(script);
    for (std::string& style : inserts.styles) style = shared_text(style);
    append(all, inserts);
  }
  return all;
}

std::string content_policy(const PageInserts& allowed) {
  return fmt::format(
      "default-src 'none'; script-src {}; style-src {}; img-src data:; base-uri 'none'; "
      "form-action 'none'; frame-ancestors 'none'",
      sources_of(allowed.scripts), sources_of(allowed.styles));
}

}  // namespace trammel
