#include "clients/cli/text/service_text.h"

#include <algorithm>
#include <ctime>
#include <map>
#include <optional>

#include "clients/cli/text/notes_text.h"
#include "server/error_sources/cause_words.h"

namespace trammel::cli {

namespace {

using nlohmann::ordered_json;

/// `2026-11-21 14:03`, UTC; `-`: nobody knows.
std::string date_text(std::int64_t unix_s) {
  if (unix_s <= 0) return "-";
  const std::time_t time = unix_s;
  std::tm parts{};
  if (::gmtime_r(&time, &parts) == nullptr) return "-";
  return fmt::format("{:04}-{:02}-{:02} {:02}:{:02}", parts.tm_year + 1900, parts.tm_mon + 1,
                     parts.tm_mday, parts.tm_hour, parts.tm_min);
}

std::string kind_in_words(const std::string& kind) {
  return kind == "diagnose" ? "diagnosis" : kind == "check" ? "check" : "training";
}

std::string job_line(const client::DatedJob& job) {
  const client::JobStatus& status = job.status;
  std::string text =
      fmt::format("job {} of cell {} ({}", status.job, status.cell, kind_in_words(job.kind));
  if (!job.batches.empty()) text += fmt::format(" of {}", fmt::join(job.batches, ", "));
  text += fmt::format(") {}", status.stage);
  if (status.stage == "training" || status.stage == "storing")
    text += fmt::format(" {:.0f} %", 100 * status.share);
  text += fmt::format(", accepted {}", date_text(job.created_unix_s));
  if (job.started_unix_s) text += fmt::format(", begun {}", date_text(*job.started_unix_s));
  if (job.finished_unix_s) text += fmt::format(", ended {}", date_text(*job.finished_unix_s));
  return text + (status.what.empty() ? "" : ": " + status.what) + "\n";
}

}  // namespace

std::string jobs_text(const std::vector<client::DatedJob>& jobs) {
  std::map<std::string, std::string> done;
  std::string unfinished, failed;
  for (const client::DatedJob& job : jobs) {
    if (job.status.stage == "done") {
      done[job.server + "/" + job.status.cell] = job_line(job);
    } else {
      (job.status.stage == "failed" ? failed : unfinished) += job_line(job);
    }
  }
  std::string text = unfinished.empty() ? "no job runs or waits\n" : unfinished;
  for (const auto& [cell, line] : done) text += line;
  return text + failed;
}

std::string all_jobs_text(const std::vector<client::DatedJob>& jobs, TableForm form) {
  if (jobs.empty()) return "no jobs\n";
  std::vector<std::vector<std::string>> rows;
  for (const client::DatedJob& job : jobs) {
    const client::JobStatus& status = job.status;
    const bool runs = status.stage == "training" || status.stage == "storing";
    rows.push_back({std::to_string(status.job), status.cell, kind_in_words(job.kind),
                    status.stage + (runs ? fmt::format(" {:.0f} %", 100 * status.share) : ""),
                    date_text(job.created_unix_s), date_text(job.started_unix_s.value_or(0)),
                    date_text(job.finished_unix_s.value_or(0)),
                    job.worker.empty() ? job.server : job.worker,
                    fmt::format("{}", fmt::join(job.batches, ", ")), status.what});
  }
  return table_text({{"job", true},
                     {"cell"},
                     {"kind"},
                     {"stage"},
                     {"accepted"},
                     {"begun", false, true},
                     {"ended", false, true},
                     {"server", false, true},
                     {"batches"},
                     {"what"}},
                    rows, form) +
         "(dates in UTC; trammel watch JOB tells how one ends)\n";
}

std::string started_text(const std::string& cell, std::int64_t job) {
  return fmt::format(
      "job {0}\n"
      "A model of cell {1} is trained now, and put in force if it is better on poses held out.\n"
      "trammel watch {0} follows it; trammel models {1} lists what came of it.\n",
      job, cell);
}

std::string models_text(const std::vector<exchange::ModelInfo>& models, TableForm form) {
  if (models.empty()) return "no models\n";
  std::vector<std::vector<std::string>> rows;
  for (const exchange::ModelInfo& model : models)
    rows.push_back({model.in_force ? "*" : "", fmt::format("{}@{}", model.cell, model.version),
                    model.id, std::to_string(model.training_poses),
                    model.validation_rms_mm ? fmt::format("{:.4f}", *model.validation_rms_mm) : "-",
                    date_text(model.trained_at_unix_s),
                    date_text(model.measured_at_unix_s.value_or(0)), model.batch_id, model.hash,
                    level_in_words(model.level)});
  std::string text = table_text({{""},
                                 {"model"},
                                 {"id", false, true},
                                 {"poses", true},
                                 {"held out mm", true},
                                 {"trained"},
                                 {"data of"},
                                 {"batch", false, true},
                                 {"hash", false, true},
                                 {"error sources"}},
                                rows, form) +
                     "(* in force; dates in UTC; trammel show MODEL tells of one)\n";
  for (const exchange::ModelInfo& model : models) {
    for (const Note& note : grave(model.notes))
      text += fmt::format("{}@{}: {}", model.cell, model.version, notes_text({note}));
    if (model.in_force && !model.budget.empty())
      text += fmt::format("{}@{}: {} (trammel show {})\n", model.cell, model.version,
                          model.budget.front(), model.cell);
  }
  return text;
}

std::string server_text(const client::ServerStatus& server) {
  return fmt::format(
             "server {} {}: {}, up {:.0f} s, {} requests ({} refused), {} jobs queued, cells: {}\n",
             server.server_id, server.version, server.state, server.uptime_s, server.requests,
             server.refused, server.queued_jobs,
             server.cells.empty() ? "none" : fmt::format("{}", fmt::join(server.cells, " "))) +
         (server.trouble.empty()
              ? ""
              : fmt::format("server {} in trouble: {}\n", server.server_id, server.trouble));
}

ordered_json server_json(const client::ServerStatus& server) {
  return {{"server", server.server_id},
          {"version", server.version},
          {"state", server.state},
          {"cells", server.cells},
          {"requests", server.requests},
          {"refused", server.refused},
          {"shed", server.shed},
          {"unheard", server.unheard},
          {"misdirected", server.misdirected},
          {"unreadable", server.unreadable},
          {"lost", server.lost},
          {"trouble", server.trouble},
          {"uptime_s", server.uptime_s},
          {"queued_jobs", server.queued_jobs}};
}

namespace {

/// Members of a server's answer, whose bytes come from outside.
std::string word_in(const ordered_json& object, const char* key) {
  const bool is_there = object.is_object() && object.contains(key) && object[key].is_string();
  return is_there ? object[key].get<std::string>() : std::string();
}

std::int64_t number_in(const ordered_json& object, const char* key) {
  const bool is_there =
      object.is_object() && object.contains(key) && object[key].is_number_integer();
  return is_there ? object[key].get<std::int64_t>() : 0;
}

bool says_yes(const ordered_json& object, const char* key) {
  return object.is_object() && object.contains(key) && object[key] == true;
}

const ordered_json& list_in(const ordered_json& object, const char* key) {
  static const ordered_json kNone = ordered_json::array();
  const bool is_there = object.is_object() && object.contains(key) && object[key].is_array();
  return is_there ? object[key] : kNone;
}

/// `serves 3 cells, trains, works on job 7 of cell-7`.
std::string part_text(const ordered_json& server) {
  std::size_t served = 0;
  for (const ordered_json& cell : list_in(server, "cells"))
    served += number_in(cell, "version") > 0 ? 1 : 0;
  std::vector<std::string> parts;
  if (says_yes(server, "serves"))
    parts.push_back(fmt::format("serves {} cell{}", served, served == 1 ? "" : "s"));
  if (says_yes(server, "trains")) parts.push_back("trains");
  for (const ordered_json& job : list_in(server, "works_on"))
    parts.push_back(
        fmt::format("works on job {} of {}", number_in(job, "job"), word_in(job, "cell")));
  const std::int64_t behind = number_in(server, "changes_behind");
  parts.push_back(behind == 0 ? "up to date"
                              : fmt::format("{} change{} behind", behind, behind == 1 ? "" : "s"));
  return fmt::format("{}", fmt::join(parts, ", "));
}

}  // namespace

void add_other_servers(const ordered_json& of_record, ordered_json& servers) {
  if (!of_record.is_array()) return;
  for (const ordered_json& one : of_record) {
    const std::string name = word_in(one, "server");
    const bool answers =
        std::any_of(servers.begin(), servers.end(),
                    [&](const ordered_json& known) { return word_in(known, "server") == name; });
    if (answers || name.empty()) continue;
    servers.push_back({{"server", name},
                       {"serves", says_yes(one, "serves")},
                       {"trains", says_yes(one, "trains")},
                       {"reachable", !says_yes(one, "gone")}});
  }
}

std::string record_text(const ordered_json& record) {
  if (word_in(record, "kind") != "postgresql") return "";
  const std::string place = word_in(record, "place");
  if (!says_yes(record, "reachable"))
    return fmt::format(
        "record: {} is away since {} UTC; what is in force is served, and every change is "
        "refused\n",
        place, date_text(number_in(record, "away_since_unix_s")));
  const bool is_unsafe = record.contains("trail_is_safe") && record["trail_is_safe"] == false;
  return fmt::format("record: {}; an acknowledged change survives {}\n", place,
                     word_in(record, "survives")) +
         (is_unsafe ? "record: the servers' role could change the audit trail; trammel store init "
                      "--grant lets in one that cannot\n"
                    : "");
}

std::string servers_text(const ordered_json& servers, const ordered_json& record) {
  if (word_in(record, "kind") != "postgresql") return "";
  if (!servers.is_array())
    return "which servers are there, and their jobs, is not known while the record is away\n";
  std::string text;
  for (const ordered_json& server : servers) {
    const std::string who =
        fmt::format("{} on {}", word_in(server, "server"), word_in(server, "host"));
    if (says_yes(server, "gone")) {
      text +=
          fmt::format("  {}: gone, not heard of since {} UTC ({} s)\n", who,
                      date_text(number_in(server, "heard_unix_s")), number_in(server, "silent_s"));
      continue;
    }
    text += fmt::format("  {} ({}, process {}): {}\n", who, word_in(server, "version"),
                        number_in(server, "pid"), part_text(server));
    for (const ordered_json& cell : list_in(server, "cells"))
      if (const std::string why = word_in(cell, "why"); !why.empty())
        text += fmt::format("    {}\n", why);
  }
  return "servers of the record:\n" + text;
}

std::string quarantine_text(const std::vector<client::BatchOfService>& batches) {
  std::string text;
  for (const client::BatchOfService& one : batches) {
    text += fmt::format("in quarantine: batch {} of cell {} ({} poses): {}\n", one.batch, one.cell,
                        one.poses, one.reason);
  }
  return text;
}

ordered_json quarantine_json(const std::vector<client::BatchOfService>& batches) {
  ordered_json list = ordered_json::array();
  for (const client::BatchOfService& one : batches) {
    list.push_back(
        {{"cell", one.cell}, {"batch", one.batch}, {"poses", one.poses}, {"reason", one.reason}});
  }
  return list;
}

namespace {

std::string state_of(const client::BatchOfService& batch) {
  if (!batch.reason.empty()) return "in quarantine: " + batch.reason;
  return batch.learned ? "learned from" : "not learned from";
}

}  // namespace

std::string batches_text(const std::vector<client::BatchOfService>& batches, TableForm form) {
  if (batches.empty()) return "no batches\n";
  // Each server states its own knowledge of a batch, and these may differ.
  const bool several = std::any_of(
      batches.begin(), batches.end(),
      [&](const client::BatchOfService& one) { return one.server != batches.front().server; });
  std::vector<std::vector<std::string>> rows;
  for (const client::BatchOfService& one : batches)
    rows.push_back({one.server, one.cell, one.batch, std::to_string(one.poses),
                    date_text(one.accepted_unix_s), one.hash, state_of(one)});
  return table_text({{"server", false, !several},
                     {"cell"},
                     {"batch"},
                     {"poses", true},
                     {"accepted"},
                     {"hash", false, true},
                     {"state"}},
                    rows, form) +
         "(dates in UTC)\n";
}

ordered_json batches_json(const std::vector<client::BatchOfService>& batches) {
  ordered_json list = ordered_json::array();
  for (const client::BatchOfService& one : batches) {
    list.push_back({{"server", one.server},
                    {"cell", one.cell},
                    {"batch", one.batch},
                    {"poses", one.poses},
                    {"accepted_unix_s", one.accepted_unix_s},
                    {"hash", one.hash},
                    {"in_quarantine", !one.reason.empty()},
                    {"reason", one.reason},
                    {"learned", one.learned}});
  }
  return list;
}

ordered_json in_force_json(const std::string& cell, int version, const ordered_json& said) {
  ordered_json now = {{"cell", cell}, {"version", version}};
  const bool is_it = said.is_object() && said.value("version", ordered_json()) == version;
  for (const char* key : {"before_mm", "after_mm", "limit_mm"})
    now[key] =
        is_it && said.contains(key) && said[key].is_number() ? said[key] : ordered_json(nullptr);
  for (const char* key : {"why", "next"})
    now[key] = is_it && said.contains(key) && said[key].is_string() ? said[key] : ordered_json("");
  if (now["why"] == "") now["why"] = "it was never held against another one on poses held out";
  return now;
}

std::string in_force_text(const ordered_json& now) {
  std::string text = fmt::format("cell {}: version {} in force\n",
                                 now.at("cell").get<std::string>(), now.at("version").get<int>());
  std::vector<std::string> figures;
  for (const auto& [name, key] :
       {std::pair("before", "before_mm"), {"after", "after_mm"}, {"limit", "limit_mm"}})
    if (now.at(key).is_number())
      figures.push_back(fmt::format("{} {:.4f} mm", name, now.at(key).get<double>()));
  if (!figures.empty()) text += fmt::format("held-out rms: {}\n", fmt::join(figures, ", "));
  text += fmt::format("why: {}\n", now.at("why").get<std::string>());
  const std::string next = now.at("next").get<std::string>();
  return next.empty() ? text : text + fmt::format("next: {}, if it is not wanted\n", next);
}

bool put_in_force(const client::JobStatus& job) {
  if (job.verdict == "in_force") return true;
  const bool says_so = job.verdict != "open";
  return !says_so && job.in_force;
}

std::string ended_text(const client::JobStatus& job) {
  std::string text = fmt::format("job {} of cell {} {}", job.job, job.cell, job.stage);
  const bool then = put_in_force(job);
  if (job.model_version > 0) {
    const char* what = then == job.in_force ? (then ? "in force" : "not in force")
                       : then ? "was put in force, and another version is in force now"
                              : "was not put in force by the job, and is in force now";
    text += fmt::format(": version {}, {}", job.model_version, what);
  }
  const bool has_changed = job.model_version > 0 && then != job.in_force;
  if (!job.what.empty())
    text += fmt::format("\n{}{}", has_changed ? "when it ended: " : "", job.what);
  return text + "\n";
}

std::string next_step(const client::JobStatus& job) {
  if (job.verdict == "quarantined") {
    return fmt::format(
        "next: trammel diagnose --service {0} says what the batch differs in; trammel "
        "retrain {0} --batch ID --release learns from it, if it is good",
        job.cell);
  }
  if (job.model_version > 0 && !job.in_force && !put_in_force(job)) {
    return fmt::format("next: trammel activate {}@{} puts it in force, if it is wanted", job.cell,
                       job.model_version);
  }
  return job.next.empty() ? "" : "next: " + job.next;
}

}  // namespace trammel::cli
