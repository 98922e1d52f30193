#include "server/http/page_shell.h"

#include <fmt/format.h>

#include <array>
#include <ctime>
#include <string_view>

#include "server/base/unix_time.h"
#include "server/report/html.h"
#include "server/report/page_parts.h"
#include "server/report/page_policy.h"

namespace trammel {
namespace {

constexpr const char* kHtml = "text/html; charset=utf-8";

/// The style that the pages of the service have beside the style of all pages.
constexpr std::string_view kStyle = R"(
  :root { --good: #007a59; --dark: #b23c00; }
  h1 { margin-bottom: 16px; }
  .wide { overflow-x: auto; }
  td { overflow-wrap: break-word; } time { white-space: nowrap; } .breaks { overflow-wrap: anywhere; }
  .now td { font-weight: 600; }
  .dark td:first-child, .served td:first-child { min-width: 9ch; }
  .dark td:first-child { border-left: 4px solid var(--dark); padding-left: 8px; }
  .served td:first-child { border-left: 4px solid var(--good); padding-left: 8px; }
  @media print { nav { display: none; } td { min-width: 11ch; } .wide { overflow: visible; } }
)";

constexpr std::string_view kWayBackStyle = R"(
  nav.service { font: 14px/1.5 system-ui, "Segoe UI", "DejaVu Sans", sans-serif; background: #1d2733; padding: 8px 24px; overflow-wrap: anywhere; }
  nav.service a { color: #fff; margin-right: 20px; }
  @media print { nav.service { display: none; } }
)";

std::string way_back(const std::string& cell, const std::string& last_check = "") {
  std::string links =
      html_link("/", "Cells") + html_link("/jobs", "Jobs") + html_link("/fleet", "Servers");
  if (!cell.empty())
    links +=
        html_link(cell_address(cell), cell) + html_link(cell_address(cell) + "/history", "History");
  if (!last_check.empty()) links += html_link(last_check, "Last check");
  return "<nav class=\"service\">" + links + "</nav>";
}

/// Puts `what` before or behind the first `mark`; the page's own head and body come before all
/// foreign text.
std::string inserted(std::string page, std::string_view mark, const std::string& what,
                     bool behind) {
  const std::size_t at = page.find(mark);
  if (at == std::string::npos) return page;
  return page.insert(behind ? at + mark.size() : at, what);
}

std::string with_way_back(const std::string& page, const std::string& cell,
                          const std::string& last_check = "") {
  const std::string style = fmt::format("<style>{}</style>\n", kWayBackStyle);
  return inserted(inserted(page, "</head>", style, false), "<body>",
                  "\n" + way_back(cell, last_check), true);
}

const PageInserts& our_inserts() {
  static const PageInserts kOurs = [] {
    PageInserts all = inserts_of_our_pages();
    all.styles.emplace_back(kStyle);
    all.styles.emplace_back(kWayBackStyle);
    return all;
  }();
  return kOurs;
}

HttpReply html_reply(int code, std::string html, std::string policy) {
  return {code, kHtml, std::move(html), {{"Content-Security-Policy", std::move(policy)}}};
}

}  // namespace

HttpReply page_reply(const ServicePage& page, int code) {
  static const std::string kPolicy = content_policy(
      {{}, {std::string(page_style()), std::string(kStyle), std::string(kWayBackStyle)}});
  const std::string again =
      page.again_after > 0
          ? fmt::format("<meta http-equiv=\"refresh\" content=\"{}\">\n", page.again_after)
          : "";
  const std::string title = html_text(page.title);
  return html_reply(
      code,
      fmt::format(
          "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
          "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
          "<link rel=\"icon\" "
          "href=\"data:,\">\n{}<title>{}</title>\n<style>{}</style>\n<style>{}</style>\n<style>{}</"
          "style>\n</head>\n<body>\n{}\n<main>\n"
          "<h1>{}</h1>\n{}\n<p class=\"note\">Read at {} UTC.</p>\n</main>\n</body>\n</html>\n",
          again, title, page_style(), kStyle, kWayBackStyle, way_back(""), title, page.body,
          shown_time(unix_now())),
      kPolicy);
}

HttpReply report_reply(const std::string& page, const std::string& cell,
                       const std::string& last_check) {
  static const std::string kPolicy = content_policy(our_inserts());
  return html_reply(200, with_way_back(page, cell, last_check), kPolicy);
}

HttpReply stored_page_reply(const std::string& page, const std::string& cell) {
  PageInserts own = inserts_of(page);
  own.styles.emplace_back(kWayBackStyle);
  return html_reply(200, with_way_back(page, cell),
                    content_policy(own) + "; sandbox allow-scripts");
}

std::string cell_address(const std::string& cell) {
  std::string address = "/cells/";
  for (const char c : cell) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                       c == '-' || c == '_' || c == '.' || c == '~';
    address += plain ? std::string(1, c) : fmt::format("%{:02X}", static_cast<unsigned char>(c));
  }
  return address;
}

std::string shown_time(std::optional<std::int64_t> unix_s) {
  if (!unix_s || *unix_s <= 0) return "–";
  const std::time_t time = *unix_s;
  std::tm utc{};
  ::gmtime_r(&time, &utc);
  std::array<char, 32> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%d %H:%M", &utc);
  return text.data();
}

std::string shown_age(double seconds) {
  constexpr double kMinute = 60, kHour = 3600, kDay = 86400;
  if (seconds < 2 * kMinute) return fmt::format("{:.0f} s", seconds);
  if (seconds < 2 * kHour) return fmt::format("{:.0f} min", seconds / kMinute);
  if (seconds < 2 * kDay) return fmt::format("{:.0f} h", seconds / kHour);
  return fmt::format("{:.0f} days", seconds / kDay);
}

}  // namespace trammel
