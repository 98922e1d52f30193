#include "server/store/database/postgres_settings.h"

#include <postgresql/libpq-fe.h>

#include <algorithm>
#include <array>
#include <memory>

#include "server/store/database/host_addresses.h"

namespace trammel {
namespace {

/// The default settings of a connection, which detect a dead line; the URL may override them.
constexpr std::array<std::pair<const char*, const char*>, 6> kDefaults = {
    {{"application_name", "trammel"},
     {"client_encoding", "UTF8"},
     {"keepalives_idle", "2"},
     {"keepalives_interval", "1"},
     {"keepalives_count", "3"},
     {"tcp_user_timeout", "3000"}}};

std::vector<std::string> parts_of(const std::string& list) {
  std::vector<std::string> parts;
  for (std::size_t begin = 0; begin <= list.size();) {
    const std::size_t end = std::min(list.find(',', begin), list.size());
    parts.push_back(list.substr(begin, end - begin));
    begin = end + 1;
  }
  return parts;
}

/// A password with an '@' or a '/' that is not written as %XX. libpq would split the URL there.
bool holds_a_password(const std::string& key, const std::string& value) {
  if (key == "port") return value.find_first_not_of("0123456789,") != value.npos;
  return (key == "dbname" && value.find('@') != value.npos) ||
         (key == "host" && !value.starts_with('/') && value.find_first_of("@/", 1) != value.npos);
}

/// One port may be that of all hosts.
std::string nth(const std::vector<std::string>& parts, std::size_t index) {
  return parts.size() == 1 ? parts.front() : index < parts.size() ? parts[index] : "";
}

}  // namespace

Result<std::vector<PostgresSettings>> settings_of(const std::string& url) {
  char* why = nullptr;
  const std::unique_ptr<PQconninfoOption, void (*)(PQconninfoOption*)> options(
      ::PQconninfoParse(url.c_str(), &why), &::PQconninfoFree);
  if (why != nullptr) ::PQfreemem(why);
  const auto unread = [] {
    return refused("is no URL that PostgreSQL reads")
        .next(
            "write postgresql://USER@HOST/DATABASE?OPTION=VALUE, and what is special in a name as "
            "%XX");
  };
  if (!options) return unread();
  PostgresSettings common;
  std::string hosts, addresses, ports;
  for (const PQconninfoOption* option = options.get(); option->keyword != nullptr; ++option) {
    if (option->val == nullptr) continue;
    const std::string key = option->keyword;
    if (holds_a_password(key, option->val)) return unread();
    if (key == "host") {
      hosts = option->val;
    } else if (key == "hostaddr") {
      addresses = option->val;
    } else if (key == "port") {
      ports = option->val;
    } else if (key != "target_session_attrs") {  // this class tests itself whether a host can be
                                                 // written
      common.emplace_back(key, option->val);
    }
  }
  for (const auto& [key, value] : kDefaults) {
    if (std::none_of(common.begin(), common.end(),
                     [&, name = key](const auto& one) { return one.first == name; }))
      common.emplace_back(key, value);
  }
  const auto names = parts_of(hosts), numbers = parts_of(addresses), at = parts_of(ports);
  std::vector<PostgresSettings> each;
  for (std::size_t i = 0; i < std::max(names.size(), numbers.size()); ++i) {
    PostgresSettings one = common;
    if (const auto host = nth(names, i); !host.empty()) one.emplace_back("host", host);
    if (const auto address = nth(numbers, i); !address.empty())
      one.emplace_back("hostaddr", address);
    if (const auto port = nth(at, i); !port.empty()) one.emplace_back("port", port);
    each.push_back(std::move(one));
  }
  return each;
}

Result<std::vector<PostgresSettings>> with_addresses(const PostgresSettings& host,
                                                     std::chrono::milliseconds limit) {
  const auto value = [&host](std::string_view key) {
    const auto found =
        std::find_if(host.begin(), host.end(), [&](const auto& one) { return one.first == key; });
    return found == host.end() ? std::string() : found->second;
  };
  const std::string name = value("host");
  const bool is_socket = name.empty() || name.front() == '/' || name.front() == '@';
  if (is_socket || !value("hostaddr").empty()) return std::vector<PostgresSettings>{host};
  const auto addresses = TRY(addresses_of(name, limit));
  std::vector<PostgresSettings> each;
  for (const std::string& address : addresses)
    each.emplace_back(host).emplace_back("hostaddr", address);
  return each;
}

}  // namespace trammel
