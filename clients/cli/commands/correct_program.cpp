#include "clients/cli/commands/correct_program.h"

#include <chrono>
#include <ctime>
#include <filesystem>

#include "clients/cam/correct_program.h"
#include "clients/cam/mark.h"
#include "clients/cli/files/program_files.h"
#include "clients/cli/service/answers.h"
#include "clients/cli/service/model_answers.h"
#include "clients/cli/terminal/output.h"
#include "clients/cli/text/receipt_page.h"
#include "clients/cli/text/receipt_text.h"
#include "clients/cli/work/in_parallel.h"
#include "server/base/plain_text.h"
#include "server/base/text_file.h"
#include "server/base/units.h"
#include "server/base/unix_time.h"
#include "server/compensate/model_file.h"
#include "server/measurement/pose_columns.h"
#include "server/report/pages_beside.h"
#include "server/robot/cell_papers.h"

namespace trammel::cli {

namespace {

namespace fs = std::filesystem;

std::string today() {
  const std::time_t now = static_cast<std::time_t>(unix_now());
  std::tm utc{};
  ::gmtime_r(&now, &utc);
  return fmt::format("{:04}-{:02}-{:02}", utc.tm_year + 1900, utc.tm_mon + 1, utc.tm_mday);
}

cam::AskCorrections ask_model(const CompensatedModel& model, ProgressLine& progress) {
  return [&](const std::string& asked_tool, const std::string& asked_payload,
             const std::vector<client::TargetMm>& targets) -> Result<client::Answer<client::CorrectedTarget>> {
    const auto known = known_tool_and_payload(model, asked_tool, asked_payload);
    if (!known) return tl::make_unexpected(known.error());
    client::Answer<client::CorrectedTarget> answer{info_of(model), {}};
    answer.items.resize(targets.size());
    const std::vector<JointType> types = joint_types(model.cell().robot);
    in_parallel(
        targets.size(),
        [&](std::size_t i) {
          answer.items[i] =
              to_wire(model.correct(from_wire(targets[i], model.cell().robot), known->tool, known->payload), types);
        },
        [&](double share) { progress.show("correcting", share); });
    return answer;
  };
}

cam::CorrectProgramOptions options_of(const CorrectProgramArguments& arguments) {
  return {arguments.tool, arguments.payload, arguments.keep_digits, TRAMMEL_VERSION, today()};
}

/// A corrected program, and what the model's cell file says of robot, instrument and operator.
struct Corrected {
  cam::CorrectedProgram program;
  CellPapers papers;
};

Result<Corrected> with_papers(Result<cam::CorrectedProgram> program, const CompensatedModel& model) {
  if (!program) return tl::make_unexpected(program.error());
  return Corrected{std::move(*program), papers_of(model.cell()).value_or(CellPapers())};
}

Result<Corrected> correct_here(const cam::Program& program, const CorrectProgramArguments& arguments) {
  const Result<CompensatedModel> model = load_model(arguments.model);
  if (!model) return tl::make_unexpected(model.error());
  ProgressLine progress;
  return with_papers(cam::correct_program(program, model->cell().robot, tools_of(*model), ask_model(*model, progress),
                                          options_of(arguments)),
                     *model);
}

/// Tools and robot come from the model that answers.
Result<Corrected> correct_by_service(const cam::Program& program, const CorrectProgramArguments& arguments) {
  return with_served_model<Corrected>(
      arguments.model, arguments.service,
      [&](client::Session& session, const client::CallContext& of, const CompensatedModel& model, const SawModel& saw) {
        ProgressLine progress;
        const cam::AskCorrections ask = [&](const std::string& tool, const std::string& payload,
                                            const std::vector<client::TargetMm>& targets) {
          client::CallContext context = of;
          context.tool = tool;
          context.payload = payload;
          auto answer =
              session.correct_targets(context, targets, [&](double share) { progress.show("correcting", share); });
          if (answer) saw(answer->model);
          return answer;
        };
        return with_papers(
            cam::correct_program(program, model.cell().robot, tools_of(model), ask, options_of(arguments)), model);
      });
}

/// Writes the files, and beside each that is changed what it was before.
Status write_files(const ProgramFiles& before, const std::vector<cam::SourceFile>& after,
                   const std::vector<bool>& keep_before, const std::vector<std::string>& paths) {
  std::vector<TextFile> files;
  for (std::size_t k = 0; k < after.size(); ++k) {
    if (paths[k] == "-") {
      if (const Status written = write_output("-", after[k].text); !written) return written;
      continue;
    }
    std::error_code error;
    const fs::path folder = fs::path(paths[k]).parent_path();
    if (!folder.empty()) fs::create_directories(folder, error);
    files.push_back({paths[k], after[k].text});
    if (keep_before[k]) files.push_back({cam::original_path(paths[k]), before.files[k].text});
  }
  return write_text_files(files);
}

Result<Extent> undo(const ProgramFiles& marked, const CorrectProgramArguments& arguments) {
  const Result<ProgramFiles> before = originals_of(marked, false);
  if (!before) return tl::make_unexpected(before.error());
  const auto paths = output_paths(marked, arguments.output);
  if (!paths) return tl::make_unexpected(paths.error());
  const std::vector<bool> none(before->files.size(), false);
  if (const Status written = write_files(*before, before->files, none, *paths); !written)
    return tl::make_unexpected(written.error());
  return Extent::kAll;
}

Status write_receipts(const Corrected& done, const CorrectProgramArguments& arguments) {
  const cam::CorrectedProgram& corrected = done.program;
  if (!arguments.report.empty()) {
    const std::string page = receipt_page(corrected, arguments.tolerance_mm, done.papers);
    const Status written = write_output(arguments.report, with_pages_beside(page, arguments.report));
    if (!written) return written;
  }
  if (!arguments.receipt.empty()) {
    if (const Status written = write_output(arguments.receipt, receipt_csv(corrected)); !written) return written;
  }
  if (arguments.json.empty()) return {};
  std::optional<ToleranceVerdict> verdict;
  if (arguments.tolerance_mm > 0) verdict = tolerance_verdict(expected_errors(corrected), arguments.tolerance_mm);
  return write_output(arguments.json, receipt_json(corrected, verdict));
}

}  // namespace

Result<Extent> correct_program(const CorrectProgramArguments& arguments) {
  Result<ProgramFiles> files = read_program_files(arguments.inputs, arguments.format);
  if (!files) return tl::make_unexpected(files.error());
  if (arguments.undo) return undo(*files, arguments);
  if (arguments.again) files = originals_of(*files, true);
  if (!files) return tl::make_unexpected(files.error());
  const auto paths = output_paths(*files, arguments.output);
  if (!paths) return tl::make_unexpected(paths.error());
  cam::ReadOptions reading{arguments.split, arguments.keep_joints, {}};
  if (!arguments.frames.empty()) {
    Result<std::map<std::string, Pose>> frames = read_frames_csv(arguments.frames);
    if (!frames) return tl::make_unexpected(frames.error());
    reading.frames = std::move(*frames);
  }
  const cam::Program program = cam::read_program(files->dialect, files->files, reading);
  const Result<Corrected> done =
      arguments.service.service ? correct_by_service(program, arguments) : correct_here(program, arguments);
  if (!done) return tl::make_unexpected(done.error());
  const cam::CorrectedProgram* const corrected = &done->program;
  const std::string left = left_alone_text(*corrected);
  if (arguments.strict && !left.empty()) return refused("nothing is written: {}", left.substr(0, left.size() - 1));
  if (const Status written = write_files(*files, corrected->files, corrected->changed, *paths); !written)
    return tl::make_unexpected(written.error());
  std::string told = receipt_summary(*corrected) + left;
  if (arguments.tolerance_mm > 0)
    told += verdict_text(tolerance_verdict(expected_errors(*corrected), arguments.tolerance_mm)) + "\n";
  fmt::print(stderr, "{}", shown_lines(told));
  if (const Status written = write_receipts(*done, arguments); !written) return tl::make_unexpected(written.error());
  const bool nothing = corrected->rows.empty();
  if (nothing)
    fmt::print(stderr, "note: no motion in it is understood as {}, so it is as it was; --format names another kind\n",
               cam::name_of(files->dialect));
  return (left.empty() && !nothing) || arguments.allow_failed ? Extent::kAll : Extent::kPart;
}

}  // namespace trammel::cli
