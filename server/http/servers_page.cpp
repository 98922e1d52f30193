#include "server/http/servers_page.h"

#include <algorithm>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "server/report/html.h"

namespace trammel {
namespace {

constexpr int kLiveAgain = 5;  // s

using Servers = std::vector<ServerInRecord>;

std::string html_time(std::optional<std::int64_t> unix_s) {
  return "<time>" + shown_time(unix_s) + "</time>";
}

std::string table(const std::vector<std::string>& head, std::vector<HtmlRow> rows) {
  return "<div class=\"wide\">" + html_table({"stacks", head, std::move(rows)}) + "</div>";
}

std::string counted(std::size_t count, const char* what) {
  return fmt::format("{} {}{}", count, what, count == 1 ? "" : "s");
}

std::string served_by(const ServerInRecord& one) {
  if (!one.self.serves) return "no";
  std::size_t served = 0, apart = 0;
  for (const auto& [cell, at] : one.self.cells) {
    served += at.version > 0 ? 1 : 0;
    apart += at.version == 0 && !at.why_not.empty() ? 1 : 0;
  }
  return counted(served, "cell") + (apart == 0 ? "" : fmt::format(", {} not served", apart));
}

bool lacks_cells(const ServerInRecord& one) {
  return std::any_of(one.self.cells.begin(), one.self.cells.end(), [](const auto& named) {
    return named.second.version == 0 && !named.second.why_not.empty();
  });
}

std::string work_of(const ServerInRecord& one) {
  if (!one.self.trains) return "no";
  std::string work;
  for (const JobAtServer& job : one.works_on)
    work += (work.empty() ? "" : ", ") +
            html_link(fmt::format("/jobs/{}", job.job), fmt::format("job {}", job.job)) + " of " +
            html_text(job.cell);
  return work.empty() ? "yes" : work;
}

HtmlRow server_row(const ServerInRecord& one) {
  const std::string state =
      one.is_gone
          ? fmt::format("gone for {}<br><span class=\"note\">not heard of since {}</span>",
                        shown_age(static_cast<double>(one.silent_s)), html_time(one.heard_at))
          : "there";
  return {{html_text(one.self.server), html_text(one.self.host), state,
           one.is_gone ? "–" : served_by(one), one.is_gone ? "–" : work_of(one),
           one.is_gone       ? "–"
           : one.behind == 0 ? "up to date"
                             : counted(static_cast<std::size_t>(one.behind), "change"),
           html_text(one.self.program), html_time(one.since)},
          one.is_gone || lacks_cells(one) ? "dark" : "served"};
}

/// The versions with which the present servers answer for a cell: `version 3: first, second`.
struct CellOfFleet {
  std::map<int, std::set<std::string>> by_version;
  std::set<std::string> why_not;
};

std::string versions_text(const CellOfFleet& cell) {
  std::string text;
  for (const auto& [version, names] : cell.by_version)
    text += (text.empty() ? "" : "<br>") +
            html_text(fmt::format("version {}: {}", version, fmt::join(names, ", ")));
  return text.empty() ? "nobody" : text;
}

/// The name of a cell, with a link if this server has a page of it.
std::string cell_name(const Watched& server, const std::string& cell) {
  return server.trainer.cells().contains(cell) ? html_link(cell_address(cell), cell)
                                               : html_text(cell);
}

std::string cells_section(const Watched& server, const Servers& servers) {
  std::map<std::string, CellOfFleet> cells;
  for (const ServerInRecord& one : servers) {
    if (one.is_gone || !one.self.serves) continue;
    for (const auto& [cell, at] : one.self.cells) {
      CellOfFleet& here = cells[cell];
      if (at.version > 0) here.by_version[at.version].insert(one.self.server);
      if (!at.why_not.empty()) here.why_not.insert(at.why_not);
    }
  }
  std::vector<HtmlRow> rows;
  for (const auto& [name, cell] : cells) {
    std::string why;
    for (const std::string& one : cell.why_not) why += (why.empty() ? "" : "<br>") + html_text(one);
    rows.push_back({{cell_name(server, name), versions_text(cell), why.empty() ? "–" : why},
                    cell.by_version.empty() || !why.empty() ? "dark" : "served"});
  }
  return html_section("Cells", rows.empty()
                                   ? "<p>None.</p>"
                                   : table({"cell", "served with", "what is wrong"}, rows));
}

std::string jobs_section(const Result<std::vector<StoredJob>>& jobs) {
  if (!jobs) return html_section("Jobs", "<p>" + html_text(sentence(jobs.error())) + "</p>");
  std::vector<HtmlRow> rows;
  for (const StoredJob& job : *jobs) {
    if (job.state != JobState::kQueued && job.state != JobState::kRunning) continue;
    const bool runs = job.state == JobState::kRunning;
    rows.push_back(
        {{html_link(fmt::format("/jobs/{}", job.id), std::to_string(job.id)), html_text(job.cell),
          runs ? "runs on " + html_text(job.server) : "waits", html_time(job.created_at)},
         runs ? "now" : ""});
  }
  return html_section("Jobs that are not over",
                      rows.empty() ? "<p>None. " + html_link("/jobs", "Those that ended") + "</p>"
                                   : table({"job", "cell", "state", "asked (UTC)"}, rows));
}

std::string verdict_of(const Servers& servers) {
  std::vector<std::string> gone;
  for (const ServerInRecord& one : servers)
    if (one.is_gone) gone.push_back(one.self.server);
  if (gone.empty())
    return servers.size() == 1 ? "Its server is there."
                               : fmt::format("All {} servers are there.", servers.size());
  return fmt::format("{} of {} gone: {}.", gone.size(), counted(servers.size(), "server"),
                     fmt::join(gone, ", "));
}

std::string record_line(const RecordState& record) {
  if (!record.reachable)
    return fmt::format(
        "<p>The record {} is away since {} UTC: what is in force is served, and every change is "
        "refused.</p>",
        html_text(record.place), html_time(record.away_since));
  return fmt::format("<p>Record: {}. An acknowledged change survives {}.</p>",
                     html_text(record.place), html_text(record.survives));
}

}  // namespace

ServicePage servers_page(const Watched& server) {
  const auto servers = server.trainer.servers();
  const RecordState record = server.store.record();
  if (!servers) {
    const std::string body =
        html_section("Now", "<p class=\"verdict\">Which servers are there is not known.</p>" +
                                record_line(record));
    return {"Servers of the record", body, kLiveAgain};
  }
  std::vector<HtmlRow> rows;
  for (const ServerInRecord& one : *servers) rows.push_back(server_row(one));
  const std::string body =
      html_section("Now",
                   fmt::format("<p class=\"verdict\">{}</p>{}<p class=\"note\">The same page on "
                               "each of them; read again every {} s.</p>",
                               html_text(verdict_of(*servers)), record_line(record), kLiveAgain)) +
      html_section("Servers", table({"server", "host", "state", "serves", "trains",
                                     "behind the record by", "program", "began (UTC)"},
                                    rows)) +
      cells_section(server, *servers) + jobs_section(server.store.recent_jobs("", 0));
  return {"Servers of the record", body, kLiveAgain};
}

}  // namespace trammel
