#include "server/store/commit_safety.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <filesystem>
#include <fstream>

#include "server/base/letters.h"
#include "server/store/statements.h"

namespace trammel {
namespace {

namespace fs = std::filesystem;

constexpr const char* kThisHost =
    "a crash of the database's host, and not its loss: this host only";

std::string spoken(int count) {
  constexpr std::array<const char*, 8> kWords = {"no",   "one",  "two", "three",
                                                 "four", "five", "six", "seven"};
  return count >= 0 && count < static_cast<int>(kWords.size())
             ? kWords.at(static_cast<std::size_t>(count))
             : std::to_string(count);
}

std::string listed(const std::vector<std::string>& names) {
  return fmt::format("{}", fmt::join(names, ", "));
}

/// The number of standbys for which a commit waits: `FIRST 2 (a, b)`, `ANY 2 (a, b)`, `2 (a, b)`,
/// or the first of a list.
int waits_for(const std::string& standby_names) {
  const std::size_t bracket = standby_names.find('(');
  if (bracket == std::string::npos) return 1;
  const auto digit =
      std::find_if(standby_names.begin(),
                   standby_names.begin() + static_cast<std::ptrdiff_t>(bracket), is_digit);
  return std::max(1, std::atoi(std::string(digit, standby_names.end()).c_str()));
}

CommitSafety alone(const CommitSettings& settings) {
  if (settings.standbys == 0) return {kThisHost, ""};
  return {kThisHost,
          fmt::format("no change waits for the {} standby{} there: set synchronous_standby_names "
                      "(Patroni: synchronous_mode), else the last changes are lost with the host",
                      spoken(settings.standbys), settings.standbys == 1 ? "" : "s")};
}

CommitSafety with_standbys(const CommitSettings& settings) {
  if (!settings.standbys_are_seen)
    return {fmt::format("the loss of the database's host: the standbys {} have it, too",
                        settings.standby_names),
            "this role may not see which standbys are there: GRANT pg_read_all_stats TO it"};
  const int asked = waits_for(settings.standby_names),
            there = static_cast<int>(settings.waited_for.size());
  if (there < asked)
    return {fmt::format("the loss of the database's host, and is made only when a standby is "
                        "there: of {} {} {}",
                        settings.standby_names, spoken(there), there == 1 ? "is" : "are"),
            "changes wait for a standby that is not there: see to it"};
  const int hosts = settings.standbys + 1;
  return {fmt::format("the loss of {} host{} of {}: {} {} it, too", spoken(asked),
                      asked == 1 ? "" : "s", spoken(hosts), listed(settings.waited_for),
                      there == 1 ? "has" : "have"),
          ""};
}

bool any_is(const fs::path& folder, const char* file, const std::string& wanted) {
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    std::ifstream in(entry.path() / file);
    std::string line;
    if (std::getline(in, line) && line == wanted) return true;
  }
  return false;
}

}  // namespace

CommitSafety safety_of(const CommitSettings& settings) {
  constexpr const char* kServers = "the end of the servers, and no crash of the database's host: ";
  if (!settings.fsync) return {std::string(kServers) + "fsync is off", "turn fsync on"};
  const std::string& commit = settings.synchronous_commit;
  if (commit == "off")
    return {std::string(kServers) + "synchronous_commit is off", "set synchronous_commit to on"};
  if (settings.standby_names.empty()) return alone(settings);
  if (commit == "local")
    return {kThisHost,
            "synchronous_commit is local, so that no change waits for a standby: set it to on"};
  return with_standbys(settings);
}

CommitSettings commit_settings(Database& database) {
  CommitSettings settings;
  Rows row = prepare(database,
                     "SELECT current_setting('synchronous_commit'), "
                     "current_setting('synchronous_standby_names'), current_setting('fsync')");
  if (!row.next()) return settings;
  settings.synchronous_commit = row.text(0);
  settings.standby_names = row.text(1);
  settings.fsync = row.text(2) == "on";
  Rows standby =
      prepare(database,
              "SELECT CAST(application_name AS TEXT), CAST(state AS TEXT), CAST(sync_state AS "
              "TEXT) FROM pg_stat_replication ORDER BY application_name");
  while (standby.next()) {
    if (standby.is_null(1)) settings.standbys_are_seen = false;
    if (standby.text(1) != "streaming") continue;
    ++settings.standbys;
    if (standby.text(2) == "sync" || standby.text(2) == "quorum")
      settings.waited_for.push_back(standby.text(0));
  }
  return settings;
}

std::string missing_watchdog(const std::string& proc, const std::string& sys) {
  if (!any_is(proc, "comm", "patroni") ||
      any_is(fs::path(sys) / "class/watchdog", "state", "active"))
    return "";
  return "Patroni runs on this host without a watchdog: a primary that hangs and wakes is ended by "
         "nobody; load softdog or the hardware's driver, and set watchdog: {mode: required} "
         "(deploy/patroni/README.md)";
}

}  // namespace trammel
