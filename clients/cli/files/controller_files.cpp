#include "clients/cli/files/controller_files.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <set>
#include <utility>

#include "clients/cam/backup/backup.h"
#include "server/base/letters.h"
#include "server/base/plain_text.h"
#include "server/base/text_file.h"

namespace trammel::cli {

namespace {

namespace fs = std::filesystem;

/// ABB's system parameters.
const std::set<std::string> kParameters = {"moc.cfg"};
/// A file that speaks of tools, frames or loads and is not read.
struct NotRead {
  cam::Dialect dialect;
  const char* ending;    ///< in lower case
  const char* sentence;  ///< behind the names
};
const std::array<NotRead, 6>& not_read() {
  static const std::array<NotRead, 6> kAll = {
      {{cam::Dialect::kInform, ".prm",
        "parameters of the controller are not read, and positions in coordinates need none of "
        "them; "
        "positions in pulses need the pulses to a degree of each axis, which pulses_per_deg in the "
        "robot file or --pulses-per-deg S,L,U,R,B,T tells"},
       {cam::Dialect::kInform, ".dat",
        "data of the controller (home positions, variables) are not read"},
       {cam::Dialect::kFanuc, ".sv",
        "binary system variables are not read: save them as text (SYSFRAME.VA) for frames, tools "
        "and loads"},
       {cam::Dialect::kFanuc, ".vr",
        "binary variables are not read: save them as text (FRAMEVAR.VA, SYSFRAME.VA) for frames "
        "and tools"},
       {cam::Dialect::kUrScript, ".urp",
        "PolyScope's own programs are not read and stay as they are: what they hold is run "
        "uncorrected, unless they call the corrected script"},
       {cam::Dialect::kUrScript, ".installation",
        "the installation is not read: tool and load are those that the script sets, or --frames "
        "and the cell tell"}}};
  return kAll;
}

/// One sentence for each kind of file in the folder that the dialect does not read.
std::vector<std::string> left_unread(cam::Dialect dialect, const std::string& folder) {
  std::vector<std::string> sentences;
  for (const NotRead& kind : not_read()) {
    if (kind.dialect != dialect) continue;
    std::vector<std::string> names;
    std::error_code error;
    for (fs::recursive_directory_iterator it(folder, error), end; !error && it != end;
         it.increment(error)) {
      if (it->is_regular_file(error) && lower(it->path().extension().string()) == kind.ending)
        names.push_back(shown(fs::relative(it->path(), folder, error).string()));
    }
    std::sort(names.begin(), names.end());
    constexpr std::size_t kNamed = 3;
    const std::size_t more = names.size() - std::min(names.size(), kNamed);
    names.resize(names.size() - more);
    if (!names.empty())
      sentences.push_back(fmt::format("{}{}: {}", fmt::join(names, ", "),
                                      more == 0 ? "" : fmt::format(" and {} more", more),
                                      kind.sentence));
  }
  return sentences;
}

}  // namespace

Result<cam::DecodedText> read_program_text(const std::string& path) {
  return read_text_file(path, kLargestProgram).map([](std::string bytes) {
    return cam::decoded(std::move(bytes));
  });
}

Result<std::vector<cam::SourceFile>> files_called(const std::set<std::string>& names,
                                                  const std::string& folder) {
  std::vector<cam::SourceFile> found;
  std::error_code error;
  for (fs::recursive_directory_iterator it(folder, error), end; !error && it != end;
       it.increment(error)) {
    if (!names.contains(lower(it->path().filename().string())) || !it->is_regular_file(error))
      continue;
    cam::DecodedText file = TRY(read_program_text(it->path().string()));
    found.push_back({fs::relative(it->path(), folder, error).string(), std::move(file.text)});
  }
  std::sort(found.begin(), found.end(),
            [](const auto& one, const auto& other) { return one.name < other.name; });
  return found;
}

bool is_of_the_controller(const std::string& name) {
  static const std::set<std::string> kFolders = {"system", "mada", "steu", "sysmod", "syspar"};
  static const std::set<std::string> kFiles = {"base.sys", "user.sys"};
  const fs::path path(name);
  const std::string file = path.filename().string();
  if (file.starts_with('$') || kFiles.contains(lower(file))) return true;
  return std::any_of(path.begin(), path.end(),
                     [&](const fs::path& part) { return kFolders.contains(lower(part.string())); });
}

Status read_values(const std::string& folder, ProgramFiles& program) {
  const auto take = [&](const std::set<std::string>& names,
                        std::vector<cam::SourceFile>& into) -> Status {
    const std::vector<cam::SourceFile> files = TRY(files_called(names, folder));
    into.insert(into.end(), files.begin(), files.end());
    return {};
  };
  if (program.dialect == cam::Dialect::kRapid) return take(kParameters, program.parameters);
  if (program.dialect != cam::Dialect::kKrl)  // which has them among its programs
    TRY(take(cam::own_lists_of(program.dialect), program.beside));
  const std::vector<std::string> sentences = left_unread(program.dialect, folder);
  program.not_read.insert(program.not_read.end(), sentences.begin(), sentences.end());
  return {};
}

bool is_listing(const std::string& path) {
  const std::string ending = lower(fs::path(path).extension().string());
  return ending == ".va" || ending == ".cnd" || ending == ".sv" || ending == ".vr";
}

Result<cam::SourceFile> read_listing(const std::string& path, cam::Dialect dialect) {
  const std::string ending = lower(fs::path(path).extension().string());
  const cam::Dialect own = ending == ".cnd" ? cam::Dialect::kInform : cam::Dialect::kFanuc;
  if (dialect != own)
    return failure(ErrorCode::kUsage, "a list of a {} controller, for a {} program",
                   cam::name_of(own), cam::name_of(dialect))
        .in(path)
        .of("--frames");
  if (ending == ".sv" || ending == ".vr")
    return refused("binary variables")
        .in(path)
        .of("--frames")
        .next("save them as text: SYSFRAME.VA");
  std::string text = TRY(read_program_text(path)).text;
  const std::vector<const char*> wanted = own == cam::Dialect::kInform
                                              ? std::vector<const char*>{"//TOOL ", "BUSER"}
                                              : std::vector<const char*>{"$MNUFRAME", "$MNUTOOL"};
  const bool any = std::any_of(wanted.begin(), wanted.end(), [&](const char* word) {
    return text.find(word) != std::string::npos;
  });
  if (!any)
    return refused("no frames or tools in it, expected {}",
                   fmt::format("{}", fmt::join(wanted, " or ")))
        .in(path)
        .of("--frames");
  return cam::SourceFile{fs::path(path).filename().string(), std::move(text)};
}

}  // namespace trammel::cli
