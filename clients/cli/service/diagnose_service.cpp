#include "clients/cli/service/diagnose_service.h"

#include <filesystem>

#include "clients/cli/terminal/output.h"
#include "clients/cli/text/diagnose_text.h"
#include "server/base/json_guard.h"
#include "server/base/plain_text.h"
#include "server/base/text_file.h"
#include "server/diagnose/diagnosis.h"
#include "server/error_sources/cause_words.h"

namespace trammel::cli {

namespace {

using nlohmann::ordered_json;

constexpr std::chrono::hours kLongest{1};

Result<std::int64_t> ask(client::Session& session, const std::string& cell,
                         const DiagnoseArguments& arguments) {
  const std::string batch = arguments.batches.empty() ? "" : arguments.batches.front();
  if (!std::filesystem::exists(batch)) return session.diagnose(cell, batch, "", arguments.apply);
  const std::string csv = TRY(read_text_file(batch));
  return session.diagnose(cell, "", csv, arguments.apply);
}

Result<client::JobStatus> wait(client::Session& session, std::int64_t job) {
  ProgressLine progress;
  return session.wait_for_job(job, kLongest, [&](const client::JobStatus& status) {
    progress.show(fmt::format("job {} {}: {}", status.job, status.stage, status.what),
                  status.share);
  });
}

/// The findings of a service, read and told; its bytes come from outside.
struct Findings {
  ordered_json json;
  std::string text;
};

Result<Findings> findings_of(const std::string& bytes, std::int64_t job) {
  const std::string what = fmt::format("what job {} found", job);
  TRY(check_json_limits(bytes, what));
  Findings findings{ordered_json::parse(bytes, nullptr, false), {}};
  try {
    if (findings.json.is_object()) {
      findings.text = diagnosis_text(findings.json);
      if (!findings.json.at("next_poses").empty()) static_cast<void>(next_poses_csv(findings.json));
      return findings;
    }
  } catch (const ordered_json::exception& error) {
    return failure(ErrorCode::kInternal, "{} is no diagnosis: {}", what, error.what());
  }
  return failure(ErrorCode::kInternal, "{} is not JSON", what);
}

}  // namespace

bool leaves_open(const ordered_json& json, const DiagnoseArguments& arguments) {
  if (!arguments.strict || json.at("verdict") == std::string(to_string(Verdict::kNothing)))
    return false;
  fmt::print(stderr, "the model lacks something: {}\n",
             shown_lines(json.at("sentence").get<std::string>()));
  return true;
}

Result<bool> diagnose_at_service(const DiagnoseArguments& arguments) {
  if (!arguments.model.empty() || !arguments.cell_out.empty()) {
    return failure(ErrorCode::kUsage, "--model and --cell-out are for files")
        .of(arguments.model.empty() ? "--cell-out" : "--model")
        .next("a service keeps its models itself");
  }
  Outputs outputs = outputs_of(arguments);
  if (arguments.batches.size() > 1)
    return failure(ErrorCode::kUsage, "a service diagnoses one batch, {} are named",
                   arguments.batches.size())
        .of("--batch");
  const std::string batch = arguments.batches.empty() ? "" : arguments.batches.front();
  TRY(outputs.check({{"--cell", arguments.cell}, {"--batch", batch}}));
  const std::string cell = TRY(cell_id(arguments.cell));
  const auto session = TRY(open_session(arguments.service));
  const std::int64_t job = TRY(ask(*session, cell, arguments));
  const client::JobStatus end = TRY(wait(*session, job));
  if (end.stage == "failed")
    return refused("job {} of cell {} failed: {}", end.job, end.cell, end.what)
        .of("job")
        .with_value(end.job);
  auto found = TRY(session->diagnosis(cell, job, !arguments.report.empty()));
  Findings findings = TRY(findings_of(found.findings_json, job));
  ordered_json& json = findings.json;
  say(findings.text, arguments);
  if (arguments.apply) {
    const int now = found.in_force.version;
    json["applied"] = {{"job", job},
                       {"outcome", end.what},
                       {"version", end.model_version},
                       {"in_force", end.in_force},
                       {"version_in_force", now > 0 ? ordered_json(now) : ordered_json(nullptr)},
                       {"error_sources_in_force", found.in_force.level}};
    say(fmt::format(
            "\n{}{}\nin force now: {}\n",
            end.model_version > 0 ? fmt::format("version {}: ", end.model_version) : "", end.what,
            now > 0 ? fmt::format("version {} ({})", now, level_in_words(found.in_force.level))
                    : "no version"),
        arguments);
  }
  if (!arguments.report.empty() && found.page_html.empty()) {
    return refused("the service has this page no more").in(arguments.report).of("--report");
  }
  TRY(write_diagnosis(json, std::move(found.page_html), outputs, arguments));
  if (!arguments.apply) return !leaves_open(json, arguments);
  if (end.in_force) return true;
  fmt::print(stderr, "not applied: cell {}: {}\n", cell, shown_lines(end.what));
  return false;
}

}  // namespace trammel::cli
