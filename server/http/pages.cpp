#include "server/http/pages.h"

#include <algorithm>
#include <charconv>
#include <nlohmann/json.hpp>

#include "server/http/live_pages.h"
#include "server/http/page_shell.h"
#include "server/http/servers_page.h"
#include "server/report/health_page.h"
#include "server/report/html.h"

namespace trammel {
namespace {

constexpr std::size_t kMostKept = 16;  // pages
constexpr std::chrono::seconds kForAMoment{2}, kForAWhile{60};

HttpReply told(int code, const std::string& title, const std::string& text) {
  return page_reply({title, "<section><p>" + html_text(text) + "</p></section>"}, code);
}

HttpReply not_there() { return told(404, "Not there", "There is no such page."); }

HttpReply refused_reply(const Error& error) {
  const bool missing = error.code == ErrorCode::kNotFound;
  const bool later = error.code == ErrorCode::kBusy;
  return told(missing ? 404
              : later ? 503
                      : 500,
              missing ? "Not there" : "Cannot be shown", sentence(error));
}

HttpReply reply_of(const Result<ServicePage>& page) {
  return page ? page_reply(*page) : refused_reply(page.error());
}

template <typename Number>
std::optional<Number> number_in(const std::string& word) {
  Number number = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), number);
  if (error != std::errc{} || end != word.data() + word.size() || number <= 0) return std::nullopt;
  return number;
}

/// The version of the model that a check was held against; 0: it is no longer on record.
int version_of(const Watched& server, const std::string& cell, const std::string& findings) {
  const auto check = nlohmann::json::parse(findings, nullptr, false);
  if (!check.is_object() || !check.contains("model") || !check["model"].is_string()) return 0;
  const auto models = server.store.models(cell);
  if (!models) return 0;
  for (auto one = models->rbegin(); one != models->rend(); ++one)
    if (one->id == check["model"].get<std::string>()) return one->version;
  return 0;
}

/// `/jobs/7/findings`, of the last check of this version; empty: none.
std::string last_check_address(const Watched& server, const std::string& cell, int version) {
  const auto checks = server.store.health_checks(cell, 0, 1);
  if (!checks || checks->empty() || version_of(server, cell, checks->back().findings) != version)
    return "";
  return fmt::format("/jobs/{}/findings", checks->back().job);
}

/// The findings of a check, with links to its cell and its job.
HttpReply health_reply(const Watched& server, const std::string& findings, const StoredJob& job) {
  const int version = version_of(server, job.cell, findings);
  const std::string model =
      version == 0 ? ""
                   : html_link(fmt::format("{}/models/{}", cell_address(job.cell), version),
                               fmt::format("Model of version {}", version)) +
                         " · ";
  const std::string links =
      fmt::format("<p>{} · {}{} · {} · {} · checked {} UTC</p>",
                  html_link(cell_address(job.cell), "Cell " + job.cell), model,
                  html_link(cell_address(job.cell) + "/history", "History"),
                  html_link(fmt::format("/jobs/{}", job.id), fmt::format("Job {}", job.id)),
                  html_link(fmt::format("/jobs/{}/findings.json", job.id), "all of it as JSON"),
                  shown_time(job.finished_at));
  return page_reply({"Health of cell " + job.cell, health_sections(findings, links)});
}

/// The findings of a diagnosis or a check: a page, or as programs read it.
HttpReply findings_reply(const Watched& server, std::int64_t job, bool for_programs) {
  const auto asked = server.store.job(job);
  if (!asked) return refused_reply(asked.error());
  const auto found = server.trainer.diagnosis(job);
  if (!found) return refused_reply(found.error());
  if (!for_programs && !found->page.empty()) return stored_page_reply(found->page, asked->cell);
  if (!for_programs && asked->kind() == JobKind::kCheck)
    return health_reply(server, found->findings, *asked);
  return {200, "application/json", found->findings};
}

}  // namespace

HttpReply Pages::answer(const HttpAsk& ask, ServerPhase phase) {
  if (phase != ServerPhase::kServing)
    return told(
        503, "Not up",
        phase == ServerPhase::kStarting ? "The service is starting." : "The service stops.");
  const auto& path = ask.path;
  if (path.empty())
    return kept("/", kForAMoment, [this] { return page_reply(fleet_page(server_)); });
  if (path[0] == "cells" && path.size() >= 2) return of_cell(ask);
  if (path[0] == "jobs") return of_job(ask);
  if (path[0] == "fleet" && path.size() == 1)
    return kept("/fleet", kForAMoment, [this] { return page_reply(servers_page(server_)); });
  return not_there();
}

HttpReply Pages::of_cell(const HttpAsk& ask) {
  const auto& path = ask.path;
  const std::string& cell = path[1];
  if (path.size() == 2)
    return kept(cell_address(cell), kForAMoment,
                [&] { return reply_of(cell_page(server_, cell)); });
  const auto report = [&](const Result<std::string>& page) {
    return page ? report_reply(*page, cell) : refused_reply(page.error());
  };
  const auto model = [&](int version) {
    const auto page = model_report(server_, cell, version);
    return page ? report_reply(*page, cell, last_check_address(server_, cell, version))
                : refused_reply(page.error());
  };
  if (path.size() == 3 && path[2] == "history")
    return kept(cell_address(cell) + "/history", kForAWhile,
                [&] { return report(history_report(server_, cell)); });
  if (path.size() != 4 || path[2] != "models") return not_there();
  const auto version = number_in<int>(path[3]);
  if (!version) return not_there();
  return kept(fmt::format("{}/models/{}", cell_address(cell), *version), kForAWhile,
              [&] { return model(*version); });
}

HttpReply Pages::of_job(const HttpAsk& ask) {
  const auto& path = ask.path;
  if (path.size() == 1)
    return kept("/jobs", kForAMoment, [this] { return reply_of(jobs_page(server_)); });
  const auto job = number_in<std::int64_t>(path[1]);
  if (!job || path.size() > 3) return not_there();
  if (path.size() == 2) return reply_of(job_page(server_, *job));
  if (path[2] == "findings") return findings_reply(server_, *job, false);
  return path[2] == "findings.json" ? findings_reply(server_, *job, true) : not_there();
}

std::optional<HttpReply> Pages::find_kept(const std::string& address) {
  const MutexLock lock(mutex_);
  std::erase_if(kept_, [now = Clock::now()](const Kept& one) { return one.until <= now; });
  const auto found = std::find_if(kept_.begin(), kept_.end(),
                                  [&](const Kept& one) { return one.address == address; });
  return found == kept_.end() ? std::nullopt : std::optional(found->reply);
}

HttpReply Pages::kept(const std::string& address, std::chrono::seconds keep,
                      const std::function<HttpReply()>& make) {
  if (auto reply = find_kept(address)) return *reply;
  const MutexLock one_at_a_time(making_);
  if (auto reply = find_kept(address)) return *reply;
  HttpReply reply = make();
  const MutexLock lock(mutex_);
  if (reply.code == 200) kept_.push_front({address, reply, Clock::now() + keep});
  if (kept_.size() > kMostKept) kept_.pop_back();
  return reply;
}

}  // namespace trammel
