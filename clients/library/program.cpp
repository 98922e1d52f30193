#include <fmt/format.h>

#include <algorithm>

#include "clients/cam/correct_program.h"
#include "clients/cam/dialect.h"
#include "clients/cam/encoding.h"
#include "clients/library/convert.h"
#include "clients/library/inside.h"
#include "clients/library/trammel/offline.h"
#include "clients/programs/model_tools.h"
#include "clients/programs/receipt_text.h"
#include "server/base/unix_time.h"
#include "server/compensate/exchanged.h"
#include "server/compensate/model_notes.h"
#include "server/exchange/si.h"
#include "server/report/page_parts.h"

namespace trammel::api {

namespace {

/// The program that the files are, and how each was encoded.
struct ReadProgram {
  cam::Program program;
  std::vector<cam::Encoding> encodings;
};

trammel::Result<ReadProgram> read_files(std::span<const ProgramFile> files,
                                        const std::string& format, const trammel::Cell& cell) {
  if (files.empty()) return failure(trammel::ErrorCode::kUsage, "no file").of("files");
  const auto dialect =
      format.empty() ? cam::dialect_of_file(files.front().name) : cam::dialect_called(format);
  if (!dialect)
    return failure(trammel::ErrorCode::kUsage, "{} says nothing of the kind of program",
                   format.empty() ? "the ending of " + files.front().name : "'" + format + "'")
        .of("format")
        .next("say format: " + cam::dialect_names());
  ReadProgram read;
  std::vector<cam::SourceFile> sources;
  for (const ProgramFile& file : files) {
    cam::DecodedText text = cam::decoded(file.text);
    read.encodings.push_back(text.encoding);
    sources.push_back({file.name, std::move(text.text)});
  }
  cam::ReadOptions options;
  if (*dialect == cam::Dialect::kInform) options.pulses_per_deg = TRY(cam::pulses_of_job(cell));
  read.program = cam::read_program(*dialect, sources, options);
  TRY(cam::check_files(read.program));
  if (!read.program.is_understood())
    return cam::no_motion_in(sources, *dialect, files.front().name);
  return read;
}

cam::AskCorrections ask_of(const CompensatedModel& model) {
  return [&model](const std::string& asked_tool, const std::string& asked_payload,
                  const std::vector<exchange::AskedTarget>& targets)
             -> trammel::Result<exchange::Answer<exchange::CorrectedTarget>> {
    const auto known = TRY(cam::known_tool_and_payload(model, asked_tool, asked_payload));
    exchange::Answer<exchange::CorrectedTarget> answer{cam::info_of(model), {}};
    const exchange::Rails rails = exchange::rails_of(model.cell().robot);
    for (const exchange::AskedTarget& target : targets)
      answer.items.push_back(exchanged(
          model.correct(target_of(target, model.cell().robot), known.tool, known.payload), rails));
    return answer;
  };
}

}  // namespace

Result<CorrectedFiles> Model::correct_program(std::span<const ProgramFile> files,
                                              const ProgramOptions& options) const {
  const CompensatedModel& model = inside_->model;
  const auto read = read_files(files, options.format, model.cell());
  if (!read) return library::passed_on(read);
  const auto corrected = cam::correct_program(
      read->program, model.cell().robot, cam::tools_of(model), ask_of(model),
      {options.tool, options.payload, options.keep_digits, TRAMMEL_VERSION, shown_day(unix_now())});
  if (!corrected) return library::passed_on(corrected);
  CorrectedFiles out;
  for (std::size_t k = 0; k < corrected->files.size(); ++k)
    out.files.push_back(
        {corrected->files[k].name, cam::encoded(corrected->files[k].text, read->encodings[k])});
  out.receipt_csv = cam::receipt_csv(*corrected);
  out.receipt_json = cam::receipt_json(*corrected, nullptr, notes_of(model));
  out.all = corrected->left_alone() == 0;
  return out;
}

}  // namespace trammel::api
