#include "clients/cli/commands/predict_program.h"

#include <algorithm>

#include "clients/cam/predict_program.h"
#include "clients/cli/files/program_files.h"
#include "clients/cli/service/answers.h"
#include "clients/cli/service/model_answers.h"
#include "clients/cli/terminal/output.h"
#include "clients/cli/text/notes_text.h"
#include "clients/cli/text/prediction_text.h"
#include "clients/cli/work/in_parallel.h"
#include "server/base/plain_text.h"
#include "server/compensate/exchanged.h"
#include "server/compensate/model_file.h"
#include "server/measurement/pose_columns.h"

namespace trammel::cli {

namespace {

constexpr std::size_t kPosesTogether = 256;  // poses that a model predicts at once

cam::AskPredictions ask_model(const CompensatedModel& model, ProgressLine& progress) {
  return [&](const std::string& asked_tool, const std::string& asked_payload,
             const std::vector<exchange::AskedJoints>& poses)
             -> Result<exchange::Answer<exchange::Prediction>> {
    const auto known = TRY(known_tool_and_payload(model, asked_tool, asked_payload));
    exchange::Answer<exchange::Prediction> answer{info_of(model), {}};
    answer.items.resize(poses.size());
    const auto portion = [&](std::size_t k) {
      std::vector<PoseContext> contexts;
      const std::size_t first = k * kPosesTogether,
                        last = std::min(first + kPosesTogether, poses.size());
      for (std::size_t i = first; i < last; ++i)
        contexts.push_back(context_of(poses[i], model.cell().robot, known.tool, known.payload));
      const std::vector<ErrorPrediction> all = model.predict_all(contexts);
      for (std::size_t i = first; i < last; ++i) answer.items[i] = exchanged(all[i - first]);
    };
    in_parallel((poses.size() + kPosesTogether - 1) / kPosesTogether, portion,
                [&](double share) { progress.show("predicting", share); });
    return answer;
  };
}

Result<cam::PredictedProgram> predict_here(const cam::Program& program,
                                           const PredictProgramArguments& arguments) {
  const CompensatedModel model = TRY(load_model(arguments.model));
  ProgressLine progress;
  return cam::predict_program(program, model.cell().robot, tools_of(model),
                              ask_model(model, progress), arguments.tool, arguments.payload);
}

Result<cam::PredictedProgram> predict_by_service(const cam::Program& program,
                                                 const PredictProgramArguments& arguments) {
  return with_served_model<cam::PredictedProgram>(
      arguments.model, arguments.service,
      [&](client::Session& session, const client::CallContext& of, const CompensatedModel& model,
          const SawModel& saw) {
        ProgressLine progress;
        const cam::AskPredictions ask = [&](const std::string& tool, const std::string& payload,
                                            const std::vector<exchange::AskedJoints>& poses) {
          client::CallContext context = of;
          context.tool = tool;
          context.payload = payload;
          auto answer = session.predict_error_at(
              context, poses, [&](double share) { progress.show("predicting", share); });
          if (answer) saw(answer->model);
          return answer;
        };
        return cam::predict_program(program, model.cell().robot, tools_of(model), ask,
                                    arguments.tool, arguments.payload);
      });
}

}  // namespace

Result<Extent> predict_program(const PredictProgramArguments& arguments) {
  const ProgramFiles files =
      TRY(read_program_files(arguments.inputs, arguments.format, arguments.task));
  cam::ReadOptions reading;
  reading.split = true;  // nothing is written, so a point may be used in several ways
  reading.idle_axes = arguments.idle_axes;
  reading.pulses_per_deg = arguments.pulses_per_deg;
  if (!arguments.service.service) TRY(take_pulses(files, arguments.model, reading));
  const cam::Program program = TRY(understood_program(files, reading, arguments.frames));
  const cam::PredictedProgram predicted =
      TRY(arguments.service.service ? predict_by_service(program, arguments)
                                    : predict_here(program, arguments));
  warn_of_notes(predicted.model.notes);
  TRY(write_output(arguments.output, prediction_csv(predicted)));
  fmt::print(stderr, "{}", shown_lines(prediction_summary(predicted)));
  if (!arguments.json.empty()) {
    TRY(write_json(arguments.json, prediction_json(predicted)));
  }
  const bool all =
      std::none_of(predicted.targets.begin(), predicted.targets.end(), [](const auto& target) {
        return target.status == "refused" || target.status == "unreachable";
      });
  return all ? Extent::kAll : Extent::kPart;
}

}  // namespace trammel::cli
