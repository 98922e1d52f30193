#include "server/base/neighbours.h"

#include <pwd.h>
#include <unistd.h>
#include <utmpx.h>

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <optional>
#include <string_view>

namespace trammel {
namespace {

constexpr uid_t kFirstPerson = 1000, kLastPerson = 60000;  // Debian's /etc/login.defs

std::optional<uid_t> uid_in(std::string_view text) {
  uid_t uid = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), uid);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return uid;
}

bool is_a_person(const Account& account) {
  const std::string_view shell = account.shell;
  const bool logs_in = !shell.ends_with("/nologin") && !shell.ends_with("/false");
  return account.uid >= kFirstPerson && account.uid <= kLastPerson && logs_in;
}

std::vector<Account> accounts_here() {
  std::vector<Account> accounts;
  ::setpwent();
  while (const passwd* one = ::getpwent())
    accounts.push_back({one->pw_name, one->pw_uid, one->pw_shell});
  ::endpwent();
  return accounts;
}

/// By systemd's folder of each session's owner, and by the older list of terminals.
std::set<uid_t> present_here(const std::vector<Account>& accounts) {
  std::set<uid_t> present;
  std::error_code none;
  for (const auto& folder : std::filesystem::directory_iterator("/run/user", none)) {
    if (const auto uid = uid_in(folder.path().filename().string())) present.insert(*uid);
  }
  ::setutxent();
  while (const utmpx* one = ::getutxent()) {
    if (one->ut_type != USER_PROCESS) continue;
    const std::string name(one->ut_user, ::strnlen(one->ut_user, sizeof one->ut_user));
    for (const Account& account : accounts) {
      if (account.name == name) present.insert(account.uid);
    }
  }
  ::endutxent();
  return present;
}

}  // namespace

Neighbours neighbours_among(const std::vector<Account>& accounts, const std::set<uid_t>& present,
                            const std::set<uid_t>& own) {
  Neighbours found;
  for (const Account& account : accounts) {
    if (!is_a_person(account) || own.contains(account.uid)) continue;
    found.may_log_in.push_back(account.name);
    if (present.contains(account.uid)) found.logged_in.push_back(account.name);
  }
  return found;
}

Neighbours neighbours() {
  std::set<uid_t> own = {::getuid(), ::geteuid()};
  const char* through_sudo = std::getenv("SUDO_UID");
  if (const auto uid = uid_in(through_sudo == nullptr ? "" : through_sudo)) own.insert(*uid);
  const std::vector<Account> accounts = accounts_here();
  return neighbours_among(accounts, present_here(accounts), own);
}

}  // namespace trammel
