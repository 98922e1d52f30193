#include "clients/cli/commands/correct_program.h"

#include <algorithm>
#include <chrono>
#include <ctime>
#include <filesystem>
#include <iterator>

#include "clients/cam/correct_program.h"
#include "clients/cam/mark.h"
#include "clients/cli/files/program_files.h"
#include "clients/cli/service/answers.h"
#include "clients/cli/service/lead_in_options.h"
#include "clients/cli/service/model_answers.h"
#include "clients/cli/terminal/output.h"
#include "clients/cli/text/notes_text.h"
#include "clients/cli/text/receipt_page.h"
#include "clients/cli/work/in_parallel.h"
#include "clients/programs/receipt_text.h"
#include "server/base/plain_text.h"
#include "server/base/text_file.h"
#include "server/base/units.h"
#include "server/base/unix_time.h"
#include "server/compensate/exchanged.h"
#include "server/compensate/model_file.h"
#include "server/compensate/model_notes.h"
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
             const std::vector<exchange::AskedTarget>& targets)
             -> Result<exchange::Answer<exchange::CorrectedTarget>> {
    const auto known = TRY(known_tool_and_payload(model, asked_tool, asked_payload));
    exchange::Answer<exchange::CorrectedTarget> answer{info_of(model), {}};
    answer.items.resize(targets.size());
    const exchange::Rails rails = exchange::rails_of(model.cell().robot);
    in_parallel(
        targets.size(),
        [&](std::size_t i) {
          const Target target = target_of(targets[i], model.cell().robot);
          answer.items[i] = exchanged(model.correct(target, known.tool, known.payload), rails);
        },
        [&](double share) { progress.show("correcting", share); });
    return answer;
  };
}

Result<cam::CorrectProgramOptions> options_of(const CorrectProgramArguments& arguments,
                                              const CompensatedModel& model) {
  cam::CorrectProgramOptions options{arguments.tool, arguments.payload, arguments.keep_digits,
                                     TRAMMEL_VERSION, today()};
  options.free_rz = !arguments.free_turn.empty();
  if (arguments.lead_in) {
    cam::LeadInOptions lead_in = TRY(lead_in_options(model, arguments.tolerance_mm));
    options.lead_in = std::move(lead_in);
  }
  return options;
}

/// A corrected program, with robot, instrument and operator from the model's cell file.
struct Corrected {
  cam::CorrectedProgram program;
  CellPapers papers;
  std::vector<Note> notes;  ///< of the model
};

Result<Corrected> with_papers(Result<cam::CorrectedProgram> program,
                              const CompensatedModel& model) {
  if (!program) return tl::make_unexpected(program.error());
  return Corrected{std::move(*program), papers_of(model.cell()).value_or(CellPapers()),
                   notes_of(model)};
}

Result<Corrected> correct_here(const cam::Program& program,
                               const CorrectProgramArguments& arguments) {
  const CompensatedModel model = TRY(load_model(arguments.model));
  const cam::CorrectProgramOptions options = TRY(options_of(arguments, model));
  ProgressLine progress;
  return with_papers(cam::correct_program(program, model.cell().robot, tools_of(model),
                                          ask_model(model, progress), options),
                     model);
}

/// Tools and robot come from the model that answers.
Result<Corrected> correct_by_service(const cam::Program& program,
                                     const CorrectProgramArguments& arguments) {
  return with_served_model<Corrected>(
      arguments.model, arguments.service,
      [&](client::Session& session, const client::CallContext& of, const CompensatedModel& model,
          const SawModel& saw) -> Result<Corrected> {
        const cam::CorrectProgramOptions options = TRY(options_of(arguments, model));
        ProgressLine progress;
        const cam::AskCorrections ask = [&](const std::string& tool, const std::string& payload,
                                            const std::vector<exchange::AskedTarget>& targets) {
          client::CallContext context = of;
          context.tool = tool;
          context.payload = payload;
          context.rails = exchange::rails_of(model.cell().robot);
          auto answer = session.correct_targets(
              context, targets, [&](double share) { progress.show("correcting", share); });
          if (answer) saw(answer->model);
          return answer;
        };
        return with_papers(
            cam::correct_program(program, model.cell().robot, tools_of(model), ask, options),
            model);
      });
}

/// The text for each path that is written, standard output among them.
using Texts = std::vector<TextFile>;

/// The files, and beside each changed one its original.
Texts texts_of(const ProgramFiles& before, const std::vector<cam::SourceFile>& after,
               const std::vector<bool>& keep_before, const std::vector<std::string>& paths) {
  Texts texts;
  for (std::size_t k = 0; k < after.size(); ++k) {
    const cam::Encoding encoding = before.encodings[k];
    texts.push_back({paths[k], cam::encoded(after[k].text, encoding)});
    if (keep_before[k] && paths[k] != "-")
      texts.push_back({cam::original_path(paths[k]), cam::encoded(before.files[k].text, encoding)});
  }
  return texts;
}

/// All or none; the folders of programs are made.
Status write_texts(const Texts& texts, const std::vector<std::string>& programs) {
  for (const std::string& path : programs) {
    std::error_code error;
    const fs::path folder = path == "-" ? fs::path() : fs::path(path).parent_path();
    if (!folder.empty()) fs::create_directories(folder, error);
  }
  std::vector<TextFile> files;
  std::copy_if(texts.begin(), texts.end(), std::back_inserter(files),
               [](const TextFile& text) { return text.path != "-"; });
  TRY(write_files(files));
  for (const TextFile& text : texts) {
    if (text.path != "-") continue;
    TRY(write_output("-", text.text));
  }
  return {};
}

/// Refuses a receipt, a page or a JSON result whose path is also a file of the program, old or
/// corrected.
Status check_receipts_are_apart(const ProgramFiles& program, const std::vector<std::string>& paths,
                                const CorrectProgramArguments& arguments) {
  Outputs receipts;
  receipts.add("--report", arguments.report);
  receipts.add("--receipt", arguments.receipt);
  receipts.add("--json", arguments.json);
  std::vector<NamedFile> taken;
  for (const std::string& path : paths) {
    if (path == "-") continue;
    taken.push_back({"a file of --output", path});
    taken.push_back({"what a file of --output was before", cam::original_path(path)});
  }
  for (const std::string& path : program.paths) {
    if (path != "-") taken.push_back({"a file of the program", path});
  }
  return receipts.check_apart(taken);
}

Result<Extent> undo(const ProgramFiles& marked, const CorrectProgramArguments& arguments) {
  const ProgramFiles before = TRY(originals_of(marked, false));
  const auto paths = TRY(output_paths(marked, arguments.output));
  const std::vector<bool> none(before.files.size(), false);
  TRY(write_texts(texts_of(before, before.files, none, paths), paths));
  return Extent::kAll;
}

std::optional<ToleranceVerdict> verdict_of(const cam::CorrectedProgram& corrected,
                                           double tolerance_mm) {
  if (tolerance_mm <= 0) return std::nullopt;
  return tolerance_verdict(expected_errors(corrected), tolerance_mm);
}

void add_receipts(const Corrected& done, const CorrectProgramArguments& arguments,
                  const std::optional<ToleranceVerdict>& verdict, Texts& texts) {
  const cam::CorrectedProgram& corrected = done.program;
  if (!arguments.report.empty()) {
    const std::string page = receipt_page(corrected, arguments.tolerance_mm, done.papers);
    texts.push_back({arguments.report, with_pages_beside(page, arguments.report)});
  }
  if (!arguments.receipt.empty()) texts.push_back({arguments.receipt, receipt_csv(corrected)});
  if (!arguments.json.empty())
    texts.push_back(
        {arguments.json,
         receipt_json(corrected, verdict ? tolerance_json(*verdict) : nullptr, done.notes)});
}

Result<cam::Program> read(const ProgramFiles& files, const CorrectProgramArguments& arguments) {
  cam::ReadOptions reading{
      arguments.split, arguments.keep_joints, {}, files.system, arguments.idle_axes};
  reading.pulses_per_deg = arguments.pulses_per_deg;
  if (!arguments.service.service) TRY(take_pulses(files, arguments.model, reading));
  return understood_program(files, std::move(reading), arguments.frames);
}

}  // namespace

Result<Extent> correct_program(const CorrectProgramArguments& arguments) {
  Result<ProgramFiles> files =
      read_program_files(arguments.inputs, arguments.format, arguments.task);
  if (!files) return tl::make_unexpected(files.error());
  if (arguments.undo) return undo(*files, arguments);
  if (arguments.again) files = originals_of(*files, true);
  if (!files) return tl::make_unexpected(files.error());
  const auto paths = TRY(output_paths(*files, arguments.output));
  TRY(check_receipts_are_apart(*files, paths, arguments));
  const cam::Program program = TRY(read(*files, arguments));
  const Corrected done = TRY(arguments.service.service ? correct_by_service(program, arguments)
                                                       : correct_here(program, arguments));
  const cam::CorrectedProgram& corrected = done.program;
  const std::string left = left_alone_text(corrected);
  const auto verdict = verdict_of(corrected, arguments.tolerance_mm);
  if (arguments.strict) {
    TRY(check_strictly(left, verdict));
  }
  warn_of_notes(done.notes);
  Texts texts = texts_of(*files, corrected.files, corrected.changed, paths);
  add_receipts(done, arguments, verdict, texts);
  TRY(write_texts(texts, paths));
  const std::string held_against = verdict ? verdict_text(*verdict) + "\n" : "";
  fmt::print(stderr, "{}", shown_lines(receipt_summary(corrected) + left + held_against));
  return left.empty() || arguments.allow_failed ? Extent::kAll : Extent::kPart;
}

}  // namespace trammel::cli
