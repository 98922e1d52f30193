#include "server/gateway/programs.h"

#include <algorithm>
#include <ctime>
#include <iterator>
#include <set>
#include <utility>

#include "clients/cam/dialect.h"
#include "clients/cam/encoding.h"
#include "clients/programs/given_poses.h"
#include "clients/programs/model_tools.h"
#include "server/base/unix_time.h"

namespace trammel {
namespace {

constexpr std::ptrdiff_t kTargetsAtOnce = 2000;  // requests of others come in between

std::string date_of_today() {
  const std::time_t now = static_cast<std::time_t>(unix_now());
  std::tm utc{};
  ::gmtime_r(&now, &utc);
  return fmt::format("{:04}-{:02}-{:02}", utc.tm_year + 1900, utc.tm_mon + 1, utc.tm_mday);
}

Result<cam::Dialect> dialect_of_sent(const SentProgram& program) {
  const std::string& name = program.files.front().name;
  const auto dialect =
      program.format.empty() ? cam::dialect_of_file(name) : cam::dialect_called(program.format);
  if (dialect) return *dialect;
  return failure(ErrorCode::kUsage, "{} says nothing of the kind of program",
                 program.format.empty() ? "the ending of " + name : "'" + program.format + "'")
      .of("format")
      .next("say format: " + cam::dialect_names());
}

/// One file is one file: a name twice would lose one of them.
Status check_names(const std::vector<cam::SourceFile>& files) {
  if (files.empty()) return failure(ErrorCode::kUsage, "no file").of("files");
  std::set<std::string> names;
  for (const cam::SourceFile& file : files) {
    if (file.name.empty() || !names.insert(file.name).second)
      return failure(ErrorCode::kUsage, "a file without a name, or two of one name")
          .of("name")
          .with_text(file.name);
  }
  return {};
}

cam::AskCorrections ask_service(ServiceCalls& calls, const CallFrom& from,
                                const ServedModel& served, CallOutcome& outcome) {
  return [&](const std::string& tool, const std::string& payload,
             const std::vector<exchange::AskedTarget>& targets)
             -> Result<exchange::Answer<exchange::CorrectedTarget>> {
    const CallAbout about{served.cell, tool, payload, false, served.model.provenance().hash};
    exchange::Answer<exchange::CorrectedTarget> all;
    auto first = targets.begin();
    do {
      const auto last = first + std::min(kTargetsAtOnce, targets.end() - first);
      auto part = TRY(calls.correct(from, about, {first, last}, outcome));
      all.model = std::move(part.model);
      std::move(part.items.begin(), part.items.end(), std::back_inserter(all.items));
      first = last;
    } while (first != targets.end());
    return all;
  };
}

/// As the command line reads the same files.
Result<cam::Program> understood(const SentProgram& program, cam::Dialect dialect,
                                const Cell& cell) {
  constexpr const char* kFrames = "frames";
  cam::ReadOptions options;
  std::vector<cam::GivenPose> rows;
  if (!program.frames.empty()) rows = TRY(cam::read_given_poses(program.frames, kFrames));
  for (const cam::GivenPose& row : rows) options.frames.emplace(row.name, row.X);
  if (dialect == cam::Dialect::kInform) options.pulses_per_deg = TRY(cam::pulses_of_job(cell));
  cam::Program read = cam::read_program(dialect, program.files, options);
  TRY(cam::check_files(read));
  if (!read.is_understood())
    return cam::no_motion_in(program.files, dialect, program.files.front().name);
  TRY(cam::check_used(rows, kFrames, read, dialect));
  return read;
}

}  // namespace

Result<ReturnedProgram> correct_sent_program(ServiceCalls& calls, const CallFrom& from,
                                             const ServedModel& served, SentProgram program,
                                             const std::string& version, CallOutcome& outcome) {
  TRY(check_names(program.files));
  const cam::Dialect dialect = TRY(dialect_of_sent(program));
  std::vector<cam::Encoding> encodings;
  for (cam::SourceFile& file : program.files) {
    cam::DecodedText text = cam::decoded(std::move(file.text));
    file.text = std::move(text.text);
    encodings.push_back(text.encoding);
  }
  const cam::Program read = TRY(understood(program, dialect, served.model.cell()));
  const cam::CorrectProgramOptions options{program.tool, program.payload, program.keep_digits,
                                           version, date_of_today()};
  ReturnedProgram returned;
  returned.corrected =
      TRY(cam::correct_program(read, served.model.cell().robot, cam::tools_of(served.model),
                               ask_service(calls, from, served, outcome), options));
  for (std::size_t k = 0; k < returned.corrected.files.size(); ++k)
    returned.files.push_back(cam::encoded(returned.corrected.files[k].text, encodings[k]));
  return returned;
}

}  // namespace trammel
