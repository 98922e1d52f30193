#include "server/http/live_pages.h"

#include <algorithm>
#include <map>
#include <utility>
#include <vector>

#include "server/base/units.h"
#include "server/base/unix_time.h"
#include "server/error_sources/cause_words.h"
#include "server/http/readiness.h"
#include "server/report/cell_needs.h"
#include "server/report/history.h"
#include "server/report/html.h"
#include "server/report/model_page.h"
#include "server/report/page_parts.h"

namespace trammel {
namespace {

constexpr int kLiveAgain = 5;                 // s
constexpr std::size_t kMostVersions = 100;    // of a cell's page
constexpr std::size_t kHistoryVersions = 10;  // whose parameters are read
constexpr std::size_t kEvents = 30;
constexpr int kJobs = 20;  // listed finished jobs, and listed failed jobs

std::string html_time(std::optional<std::int64_t> unix_s) {
  return "<time>" + shown_time(unix_s) + "</time>";
}

/// Text that may be broken anywhere, as hashes are.
std::string breakable(const std::string& text) {
  return "<span class=\"breaks\">" + html_text(text) + "</span>";
}

std::string table(const std::vector<std::string>& head, std::vector<HtmlRow> rows) {
  return "<div class=\"wide\">" + html_table({"stacks", head, std::move(rows)}) + "</div>";
}

/// `not_better` as two words.
std::string apart_words(std::string word) {
  std::replace(word.begin(), word.end(), '_', ' ');
  return word;
}

std::string millimetres(const std::optional<double>& m) {
  return m && *m > 0 ? fmt::format("{:.4f}", to_mm(*m)) : "–";
}

std::string model_address(const std::string& cell, int version) {
  return fmt::format("{}/models/{}", cell_address(cell), version);
}

std::string job_address(std::int64_t job) { return fmt::format("/jobs/{}", job); }

const char* kind_of(JobKind kind) {
  switch (kind) {
    case JobKind::kTrain:
      return "training";
    case JobKind::kDiagnose:
      return "diagnosis";
    case JobKind::kCheck:
      return "check";
  }
  return "";
}

std::string state_of(const CellReadiness& one) {
  std::string text = html_text(apart_words(to_text(one.state)));
  if (!one.why.empty()) text += "<br><span class=\"note\">" + html_text(one.why) + "</span>";
  return text;
}

std::string troubles_of(const Watched& server) {
  const std::vector<std::string> troubles = server.trainer.troubles();
  if (troubles.empty()) return "";
  std::string list;
  for (const std::string& one : troubles) list += "<li>" + html_text(one) + "</li>";
  return html_section("What is wrong now", "<ul>" + list + "</ul>");
}

using InMemory = std::map<std::string, ServedModelPtr>;

InMemory in_memory(const Watched& server) {
  InMemory models;
  for (ServedModelPtr& model : server.registry.all()) {
    std::string cell = model->cell;
    models[std::move(cell)] = std::move(model);
  }
  return models;
}

/// The last check of a cell; empty: none, or the record is away.
std::string last_check_of(const Watched& server, const std::string& cell) {
  const auto checks = server.store.health_checks(cell, 0, 1);
  return checks && !checks->empty() ? checks->back().findings : "";
}

const ServedModel* model_in(const InMemory& models, const std::string& cell) {
  const auto found = models.find(cell);
  return found == models.end() ? nullptr : found->second.get();
}

CellNeed need_of_cell(const Watched& server, const CellReadiness& one, const InMemory& models,
                      std::int64_t now) {
  const ServedModel* model = model_in(models, one.cell);
  if (model == nullptr && !one.is_dark())
    return {CellNeed::Urgency::kFine, "It is answered for; its model is loaded when it is asked.",
            ""};
  const auto kept_out = server.trainer.quarantined(one.cell);
  return need_of({.cell = one.cell,
                  .model = model == nullptr ? nullptr : &model->model,
                  .dark_because = one.is_dark() ? one.why : "",
                  .last_check = model == nullptr ? "" : last_check_of(server, one.cell),
                  .in_training = one.state == CellReadiness::State::kInTraining,
                  .kept_out = kept_out ? kept_out->size() : 0,
                  .now = now});
}

std::string need_html(const CellNeed& need) {
  return need_badge(to_text(need.urgency)) + html_text(need.sentence) +
         (need.action.empty() ? "" : " <b>To do:</b> " + html_text(need.action));
}

/// `2 of 3 cells are fine; cell-7 needs something now.`
std::string verdict_on(const std::vector<std::pair<std::string, CellNeed>>& needs) {
  std::vector<std::string> now, soon;
  for (const auto& [cell, need] : needs) {
    if (need.urgency == CellNeed::Urgency::kNow) now.push_back(cell);
    if (need.urgency == CellNeed::Urgency::kSoon) soon.push_back(cell);
  }
  const std::size_t fine = needs.size() - now.size() - soon.size();
  std::string text = needs.size() == 1 ? (fine == 1 ? "Its cell is fine" : "Its cell is not fine")
                     : fine == 0       ? fmt::format("None of {} cells is fine", needs.size())
                                       : fmt::format("{} of {} cells {} fine", fine, needs.size(),
                                               fine == 1 ? "is" : "are");
  if (!now.empty()) text += fmt::format("; act now: {}", fmt::join(now, ", "));
  if (!soon.empty()) text += fmt::format("; see to: {}", fmt::join(soon, ", "));
  return text + ".";
}

HtmlRow fleet_row(const CellReadiness& one, const CellNeed& need, const InMemory& models,
                  std::int64_t now) {
  HtmlRow row{{html_link(cell_address(one.cell), one.cell), need_html(need), state_of(one)},
              one.is_dark() ? "dark" : "served"};
  const ServedModel* model = model_in(models, one.cell);
  const int version = model == nullptr ? one.version : model->version;
  row.cells.push_back(
      version == 0 ? "–" : html_link(model_address(one.cell, version), std::to_string(version)));
  if (model == nullptr) {
    row.cells.insert(row.cells.end(), 3, "–");
    return row;
  }
  const ModelProvenance& made = model->model.provenance();
  const auto& judged = model->model.parts().validation;
  row.cells.push_back(html_time(made.trained_at));
  row.cells.push_back(made.measured_at ? shown_age(static_cast<double>(now - *made.measured_at))
                                       : "–");
  row.cells.push_back(millimetres(
      judged && judged->poses > 0 ? std::optional(judged->compensated.rms) : std::nullopt));
  return row;
}

std::string outcome_of(const StoredJob& job, const std::optional<JobProgress>& now) {
  if (now && now->stage == JobStage::kQueued)
    return now->what.empty() ? "waits" : "waits: " + html_text(now->what);
  if (now) return fmt::format("{}, {:.0f} %", html_text(now->what), 100 * now->share);
  const std::string verdict = apart_words(to_text(job.outcome.verdict));
  const std::string why = with_micro(job.outcome.why.empty() ? job.message : job.outcome.why);
  if (job.kind() != JobKind::kTrain && !why.empty()) return html_text(why);
  return html_text(why.empty() ? verdict : verdict + ": " + why);
}

using Unfinished = std::map<std::int64_t, JobProgress>;

Unfinished unfinished(const Watched& server) {
  Unfinished jobs;
  for (JobProgress& job : server.trainer.unfinished_jobs()) jobs[job.job] = std::move(job);
  return jobs;
}

std::optional<JobProgress> progress_in(const Unfinished& jobs, std::int64_t job) {
  const auto found = jobs.find(job);
  return found == jobs.end() ? std::nullopt : std::optional(found->second);
}

std::string batches_of(const StoredJob& job) {
  return job.batch_ids.empty() ? "sent with it"
                               : html_text(fmt::format("{}", fmt::join(job.batch_ids, ", ")));
}

bool has_findings(const StoredJob& job) {
  return job.kind() != JobKind::kTrain && job.state == JobState::kDone;
}

/// `Last check, 2026-11-22: healthy`, with a link to its findings; empty without a recent check.
std::string last_of(const std::vector<StoredJob>& jobs, JobKind kind) {
  const StoredJob* last = nullptr;  // the jobs come oldest first
  for (const StoredJob& job : jobs)
    if (job.kind() == kind && has_findings(job)) last = &job;
  if (last == nullptr) return "";
  const std::string name =
      fmt::format("Last {}, {} UTC", kind_of(kind), shown_time(last->finished_at));
  return fmt::format("<p>{}: {}</p>", html_link(job_address(last->id) + "/findings", name),
                     outcome_of(*last, std::nullopt));
}

/// Newest first.
Result<std::string> job_table(const Watched& server, const std::string& cell) {
  const auto jobs = TRY(server.store.recent_jobs(cell, kJobs));
  if (jobs.empty()) return std::string("<p>None.</p>");
  const Unfinished running = unfinished(server);
  std::vector<HtmlRow> rows;
  for (auto job = jobs.rbegin(); job != jobs.rend(); ++job) {
    const auto now = progress_in(running, job->id);
    rows.push_back(
        {{html_link(job_address(job->id), std::to_string(job->id)),
          html_link(cell_address(job->cell), job->cell), kind_of(job->kind()), batches_of(*job),
          html_time(job->created_at), html_time(job->finished_at),
          job->server.empty() ? "–" : html_text(job->server),
          outcome_of(*job, now) +
              (has_findings(*job)
                   ? "<br>" + html_link(job_address(job->id) + "/findings", "what it found")
                   : "")},
         now ? "now" : ""});
  }
  return table(
      {"job", "cell", "what", "batches", "asked (UTC)", "ended (UTC)", "server", "outcome"}, rows);
}

Result<std::string> version_table(const Watched& server, const std::string& cell) {
  const auto versions = TRY(server.store.models(cell));
  if (versions.empty()) return std::string("<p>None yet.</p>");
  const int in_force = server.registry.version_in_force(cell);
  std::vector<HtmlRow> rows;
  for (auto one = versions.rbegin(); one != versions.rend() && rows.size() < kMostVersions; ++one) {
    const bool now = one->version == in_force;
    rows.push_back({{html_link(model_address(cell, one->version), std::to_string(one->version)) +
                         (now ? " in force" : ""),
                     html_time(one->trained_at), html_time(one->measured_at),
                     html_text(one->batch_id), html_text(level_in_words(one->level)),
                     std::to_string(one->training_poses), millimetres(one->validation_rms)},
                    now ? "now" : ""});
  }
  return table({"version", "trained (UTC)", "measured (UTC)", "batches", "error sources", "poses",
                "held-out rms, mm"},
               rows);
}

Result<std::string> quarantine_table(const Watched& server, const std::string& cell) {
  const auto batches = TRY(server.trainer.quarantined(cell));
  std::vector<HtmlRow> rows;
  for (const StoredBatch& batch : batches)
    rows.push_back({{html_text(batch.id), std::to_string(batch.poses), html_time(batch.accepted_at),
                     html_text(batch.quarantine)}});
  return rows.empty() ? std::string()
                      : table({"batch", "poses", "came (UTC)", "why it is kept out"}, rows);
}

std::string event_table(const AuditTrail& trail) {
  std::vector<HtmlRow> rows;
  for (auto row = trail.rows.rbegin(); row != trail.rows.rend(); ++row)
    rows.push_back({{html_time(row->at), html_text(row->what), html_text(row->subject),
                     breakable(row->before + (row->after.empty() ? "" : " → " + row->after)),
                     html_text(row->why), breakable(row->who)}});
  std::string html =
      rows.empty() ? "<p>None.</p>"
                   : table({"when (UTC)", "what", "of what", "before → after", "why", "who"}, rows);
  if (trail.broken)
    html = "<p>The trail is broken: " + html_text(sentence(*trail.broken)) + "</p>" + html;
  return html;
}

/// A section, or why there is none.
void add_section(std::string* body, const std::string& title, const Result<std::string>& html) {
  if (html && html->empty()) return;
  *body += html_section(
      title, html ? *html : "<p>Cannot be read: " + html_text(sentence(html.error())) + "</p>");
}

CellReadiness readiness_of(const Watched& server, const std::string& cell) {
  for (CellReadiness& one : cells_readiness(server)) {
    if (one.cell == cell) return std::move(one);
  }
  return {cell, CellReadiness::State::kUntrained};
}

Status check_served(const Watched& server, const std::string& cell) {
  return find_cell(server.trainer.cells(), cell).map([](const auto&) {});
}

Result<CompensatedModel> model_of(const Watched& server, const std::string& cell, int version) {
  const InMemory models = in_memory(server);
  const auto found = models.find(cell);
  if (found != models.end() && found->second->version == version) return found->second->model;
  return server.store.model(cell, version);
}

}  // namespace

ServicePage fleet_page(const Watched& server) {
  std::vector<CellReadiness> cells = cells_readiness(server);
  const InMemory models = in_memory(server);
  const std::int64_t today = unix_now();
  std::vector<std::pair<std::string, CellNeed>> needs;
  std::map<std::string, CellNeed> by_cell;
  for (const CellReadiness& one : cells) {
    needs.emplace_back(one.cell, need_of_cell(server, one, models, today));
    by_cell[one.cell] = needs.back().second;
  }
  std::stable_sort(cells.begin(), cells.end(), [&](const CellReadiness& a, const CellReadiness& b) {
    return by_cell[a.cell].urgency > by_cell[b.cell].urgency;
  });
  std::vector<HtmlRow> rows;
  for (const CellReadiness& one : cells)
    rows.push_back(fleet_row(one, by_cell[one.cell], models, today));
  const std::string verdict = html_text(verdict_on(needs));
  const Movement movement = server.movement();
  const std::string still =
      movement.still.empty()
          ? ""
          : fmt::format("<p>No progress in: {}</p>",
                        html_text(fmt::format("{}", fmt::join(movement.still, ", "))));
  const auto running = server.trainer.unfinished_jobs().size();
  const std::string body =
      html_section("Now",
                   fmt::format("<p class=\"verdict\">{}</p>{}<p>{}: {} wait or run. {}: who serves "
                               "and trains.</p><p class=\"note\">{} {}, read again every {} s.</p>",
                               verdict, still, html_link("/jobs", "Jobs"), running,
                               html_link("/fleet", "Servers"), html_text(server.server_id),
                               html_text(server.program_version), kLiveAgain)) +
      troubles_of(server) +
      html_section("Cells", table({"cell", "what it needs", "state", "version", "trained (UTC)",
                                   "age of its data", "held-out rms, mm"},
                                  rows));
  return {"Cells of " + server.server_id, body, kLiveAgain};
}

Result<ServicePage> cell_page(const Watched& server, const std::string& cell) {
  TRY(check_served(server, cell));
  const CellReadiness now = readiness_of(server, cell);
  const std::string report = now.version == 0
                                 ? ""
                                 : html_link(model_address(cell, now.version),
                                             fmt::format("Report of version {}", now.version)) +
                                       " · ";
  const std::vector<StoredJob> lately =
      server.store.recent_jobs(cell, kJobs).value_or(std::vector<StoredJob>());
  std::string body = html_section(
      "Now", fmt::format("<p class=\"verdict\">{}: {}</p><p>{}{}</p>",
                         now.is_dark() ? "Dark" : "Answered for", state_of(now), report,
                         html_link(cell_address(cell) + "/history", "History of its parameters")) +
                 "<p>" + need_html(need_of_cell(server, now, in_memory(server), unix_now())) +
                 "</p>" + last_of(lately, JobKind::kCheck) + last_of(lately, JobKind::kDiagnose));
  add_section(&body, "Versions", version_table(server, cell));
  add_section(&body, "Batches that are kept out", quarantine_table(server, cell));
  add_section(&body, "Jobs", job_table(server, cell));
  add_section(&body, "Changes", server.store.audit({cell, 0, kEvents}).map(event_table));
  return ServicePage{"Cell " + cell, body};
}

Result<ServicePage> jobs_page(const Watched& server) {
  const auto jobs = TRY(job_table(server, ""));
  return ServicePage{"Jobs", html_section("Newest first", jobs), kLiveAgain};
}

Result<ServicePage> job_page(const Watched& server, std::int64_t id) {
  const auto job = TRY(server.store.job(id));
  const auto now = progress_in(unfinished(server), id);
  std::vector<HtmlRow> rows = {{{"cell", html_link(cell_address(job.cell), job.cell)}},
                               {{"what", kind_of(job.kind())}},
                               {{"batches", batches_of(job)}},
                               {{"asked (UTC)", html_time(job.created_at)}},
                               {{"begun (UTC)", html_time(job.started_at)}},
                               {{"ended (UTC)", html_time(job.finished_at)}},
                               {{"server", job.server.empty() ? "–" : html_text(job.server)}},
                               {{"outcome", outcome_of(job, now)}}};
  const JobOutcome& outcome = job.outcome;
  if (outcome.before || outcome.after)
    rows.push_back({{"held-out rms, mm",
                     fmt::format("before {}, after {}, limit {}", millimetres(outcome.before),
                                 millimetres(outcome.after), millimetres(outcome.limit))}});
  if (!outcome.next.empty()) rows.push_back({{"next", html_text(outcome.next)}});
  if (job.model_version > 0)
    rows.push_back({{"model", html_link(model_address(job.cell, job.model_version),
                                        fmt::format("version {}", job.model_version))}});
  if (job.kind() != JobKind::kTrain && !now)
    rows.push_back({{"found", html_link(job_address(id) + "/findings", "what it found")}});
  return ServicePage{fmt::format("Job {}", id),
                     html_section("What became of it", html_table({"", {}, rows})),
                     now ? kLiveAgain : 0};
}

Result<std::string> model_report(const Watched& server, const std::string& cell, int version) {
  TRY(check_served(server, cell));
  return model_of(server, cell, version).map([&](const CompensatedModel& model) {
    return model_page(model, std::nullopt, last_check_of(server, cell));
  });
}

Result<std::string> history_report(const Watched& server, const std::string& cell) {
  TRY(check_served(server, cell));
  const auto versions = TRY(server.store.models(cell));
  CellHistory history{cell};
  const int in_force = server.registry.version_in_force(cell);
  const std::size_t skipped = versions.size() - std::min(versions.size(), kHistoryVersions);
  for (std::size_t i = skipped; i < versions.size(); ++i) {
    const StoredModel& stored = versions[i];
    VersionOnRecord one{
        stored.version,
        stored.id,
        stored.batch_id,
        stored.trained_at,
        stored.training_poses,
        stored.validation_rms > 0 ? std::optional(stored.validation_rms) : std::nullopt,
        stored.version == in_force};
    if (const auto model = model_of(server, cell, stored.version)) put_on_record(*model, one);
    history.versions.push_back(std::move(one));
  }
  for (const StoredJob& job :
       server.store.recent_jobs(cell, kJobs).value_or(std::vector<StoredJob>())) {
    if (job.kind() != JobKind::kTrain || !job.finished_at) continue;
    history.trainings.push_back({*job.finished_at, fmt::format("{}", fmt::join(job.batch_ids, "+")),
                                 to_text(job.outcome.verdict), job.outcome.why, job.outcome.before,
                                 job.outcome.after});
  }
  if (const auto trail = server.store.audit({cell, 0, 10 * kEvents})) {
    for (const AuditRow& row : trail->rows)
      history.events.push_back(
          {row.at, row.what, row.subject, row.why, row.who, row.before, row.after});
  }
  return history_page(history);
}

}  // namespace trammel
