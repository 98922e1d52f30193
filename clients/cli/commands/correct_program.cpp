#include "clients/cli/commands/correct_program.h"

#include <chrono>
#include <ctime>
#include <filesystem>

#include "clients/cam/correct_program.h"
#include "clients/cam/mark.h"
#include "clients/cli/files/program_files.h"
#include "clients/cli/service/answers.h"
#include "clients/cli/terminal/output.h"
#include "clients/cli/text/receipt_page.h"
#include "clients/cli/text/receipt_text.h"
#include "server/base/plain_text.h"
#include "server/base/text_file.h"
#include "server/base/units.h"
#include "server/base/unix_time.h"
#include "server/compensate/model_file.h"
#include "server/measurement/pose_columns.h"

namespace trammel::cli {

namespace {

namespace fs = std::filesystem;

std::string today() {
  const std::time_t now = static_cast<std::time_t>(unix_now());
  std::tm utc{};
  ::gmtime_r(&now, &utc);
  return fmt::format("{:04}-{:02}-{:02}", utc.tm_year + 1900, utc.tm_mon + 1, utc.tm_mday);
}

cam::CellTools tools_of(const CompensatedModel& model) { return {model.parts().physics.tools, model.cell().payloads}; }

/// As a server reads it, so that both give the same bytes.
Target from_wire(const client::TargetMm& wanted, const Chain& robot) {
  Target target;
  target.joint_target = wanted.joint_target;
  if (!target.joint_target) {
    const client::PoseMm& pose = wanted.pose;
    const Eigen::Quaterniond R(pose.qw, pose.qx, pose.qy, pose.qz);
    target.X_BT = make_pose(R.normalized().toRotationMatrix(), Vector3(pose.x_mm, pose.y_mm, pose.z_mm) * from_mm(1));
  }
  target.conf = wanted.conf;
  if (wanted.conf || wanted.seed_rad.empty()) return target;
  JointVector seed(robot.size());
  for (int j = 0; j < robot.size(); ++j) {
    const double value = wanted.seed_rad[static_cast<std::size_t>(j)];
    seed(j) = robot.joint(j).type == JointType::kPrismatic ? from_mm(value) : value;
  }
  target.seed = seed;
  return target;
}

client::ModelInfo info_of(const CompensatedModel& model) {
  const ModelProvenance& provenance = model.provenance();
  client::ModelInfo info;
  info.cell = model.cell().name;
  info.id = provenance.id;
  info.hash = provenance.hash;
  info.level = provenance.level;
  info.batch_id = provenance.batch_id;
  info.trained_at_unix_s = provenance.trained_at;
  info.measured_at_unix_s = provenance.measured_at;
  info.training_poses = provenance.training_poses;
  return info;
}

cam::AskCorrections ask_model(const CompensatedModel& model, ProgressLine& progress) {
  return [&](const std::string& asked_tool, const std::string& asked_payload,
             const std::vector<client::TargetMm>& targets) -> Result<client::Answer<client::CorrectedTarget>> {
    const Result<std::string> tool = resolve_tool(model.cell(), asked_tool);
    if (!tool) return tl::make_unexpected(tool.error());
    const Result<std::string> payload = resolve_payload(model.cell(), asked_payload);
    if (!payload) return tl::make_unexpected(payload.error());
    if (const Status known = model.check_trained_with(*tool, *payload); !known)
      return tl::make_unexpected(known.error());
    client::Answer<client::CorrectedTarget> answer{info_of(model), {}};
    const std::vector<JointType> types = joint_types(model.cell().robot);
    for (const client::TargetMm& target : targets) {
      progress.show("correcting", static_cast<double>(answer.items.size()) / static_cast<double>(targets.size()));
      answer.items.push_back(to_wire(model.correct(from_wire(target, model.cell().robot), *tool, *payload), types));
    }
    return answer;
  };
}

cam::CorrectProgramOptions options_of(const CorrectProgramArguments& arguments) {
  return {arguments.tool, arguments.payload, arguments.keep_digits, TRAMMEL_VERSION, today()};
}

Result<cam::CorrectedProgram> correct_here(const cam::Program& program, const CorrectProgramArguments& arguments) {
  const Result<CompensatedModel> model = load_model(arguments.model);
  if (!model) return tl::make_unexpected(model.error());
  ProgressLine progress;
  return cam::correct_program(program, model->cell().robot, tools_of(*model), ask_model(*model, progress),
                              options_of(arguments));
}

/// Tools and robot come from the model that answers: it is fetched, and fetched again if another one has answered.
Result<cam::CorrectedProgram> correct_by_service(const cam::Program& program,
                                                 const CorrectProgramArguments& arguments) {
  constexpr int kAttempts = 5;
  const Result<ModelReference> reference = parse_model_reference(arguments.model);
  if (!reference) return tl::make_unexpected(reference.error());
  const auto session = open_session(arguments.service);
  if (!session) return tl::make_unexpected(session.error());
  ProgressLine progress;
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    const Result<std::string> text = (*session)->export_model(reference->cell, reference->version);
    if (!text) return tl::make_unexpected(text.error());
    const Result<CompensatedModel> model = deserialize(*text, arguments.model);
    if (!model) return tl::make_unexpected(model.error());
    bool another = false;
    const cam::AskCorrections ask = [&](const std::string& tool, const std::string& payload,
                                        const std::vector<client::TargetMm>& targets) {
      client::CallContext context;
      context.cell = reference->cell;
      context.tool = tool;
      context.payload = payload;
      if (reference->version > 0) context.model = fmt::format("@{}", reference->version);
      auto answer =
          (*session)->correct_targets(context, targets, [&](double share) { progress.show("correcting", share); });
      another |= answer && answer->model.hash != model->provenance().hash;
      return answer;
    };
    Result<cam::CorrectedProgram> corrected =
        cam::correct_program(program, model->cell().robot, tools_of(*model), ask, options_of(arguments));
    if (!another) return corrected;
  }
  return failure(ErrorCode::kBusy, "cell {}: the model changed during each of {} attempts", reference->cell, kAttempts);
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

Status write_receipts(const cam::CorrectedProgram& corrected, const CorrectProgramArguments& arguments) {
  if (!arguments.report.empty()) {
    const Status written = write_output(arguments.report, receipt_page(corrected, arguments.tolerance_mm));
    if (!written) return written;
  }
  if (!arguments.receipt.empty()) {
    if (const Status written = write_output(arguments.receipt, receipt_csv(corrected)); !written) return written;
  }
  nlohmann::ordered_json json = receipt_json(corrected);
  if (arguments.tolerance_mm > 0) {
    const ToleranceVerdict verdict = tolerance_verdict(corrected, arguments.tolerance_mm);
    json["tolerance"] = {{"tolerance_mm", verdict.tolerance_mm},
                         {"targets", verdict.targets},
                         {"inside_before", verdict.before},
                         {"inside_after", verdict.after},
                         {"expected_inside_after", verdict.expected_after}};
  }
  return write_json(arguments.json, json);
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
  const Result<cam::CorrectedProgram> corrected =
      arguments.service.service ? correct_by_service(program, arguments) : correct_here(program, arguments);
  if (!corrected) return tl::make_unexpected(corrected.error());
  const std::string left = left_alone_text(*corrected);
  if (arguments.strict && !left.empty()) return refused("nothing is written: {}", left.substr(0, left.size() - 1));
  if (const Status written = write_files(*files, corrected->files, corrected->changed, *paths); !written)
    return tl::make_unexpected(written.error());
  std::string told = receipt_summary(*corrected) + left;
  if (arguments.tolerance_mm > 0) told += verdict_text(tolerance_verdict(*corrected, arguments.tolerance_mm)) + "\n";
  fmt::print(stderr, "{}", shown_lines(told));
  if (const Status written = write_receipts(*corrected, arguments); !written)
    return tl::make_unexpected(written.error());
  return left.empty() || arguments.allow_failed ? Extent::kAll : Extent::kPart;
}

}  // namespace trammel::cli
