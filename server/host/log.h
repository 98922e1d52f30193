#pragma once

#include <string>
#include <utility>
#include <vector>

#include "server/base/result.h"
#include "server/host/log_options.h"

/// The log of the process: a fact a line, as text for people or as JSON for programs. A line waits
/// for nobody: what does not go at once is dropped and counted. Of one kind of fact at most
/// LogLimit::kMost lines a minute are written (of level debug all); the next one says how many were
/// left out. Thread-safe, start_log() excepted.
namespace trammel {

enum class LogLevel { kDebug, kInfo, kWarn, kError };

/// The subject of a fact, by name: `cell`, `who`, `trace`. Empty values are left out.
using LogAbout = std::vector<std::pair<const char*, std::string>>;

/// Call it before any other thread starts. Refuses a file that cannot be opened.
[[nodiscard]] Status start_log(const LogOptions& options);
/// From now on these; the file stays.
void change_log(const LogOptions& options);
/// `kind`: one word for all facts of this kind. `text`: the fact for people, in one clause.
void tell(LogLevel level, const char* kind, const std::string& text, const LogAbout& about = {});
/// One line of JSON, without time and level, as tell() writes it.
[[nodiscard]] std::string log_members(const char* kind, const std::string& text,
                                      const LogAbout& about);

}  // namespace trammel
