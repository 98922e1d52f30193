#include "server/store/store_place.h"

#include <algorithm>

#include "server/store/database/postgres_settings.h"

namespace trammel {
namespace {

std::string value_of(const PostgresSettings& settings, std::string_view key) {
  const auto found = std::find_if(settings.begin(), settings.end(),
                                  [&](const auto& one) { return one.first == key; });
  return found == settings.end() ? std::string() : found->second;
}

/// A host with its port; empty for a socket, since its folder is no name.
std::string host_of(const PostgresSettings& settings) {
  std::string host = value_of(settings, "host");
  if (host.empty()) host = value_of(settings, "hostaddr");
  if (host.starts_with('/')) host.clear();
  const std::string port = value_of(settings, "port");
  return port.empty() ? host : host + ":" + port;
}

}  // namespace

bool is_postgres_url(std::string_view place) {
  const auto has = [place](std::string_view text) { return place.find(text) != place.npos; };
  return has("://") || has("password=") || (has("=") && settings_of(std::string(place)));
}

std::string spoken_place(const std::string& place) {
  if (!is_postgres_url(place)) return place;
  const auto each = settings_of(place);
  if (!each) return "postgresql://...";
  // The part of a user name from a '?' on was meant as an option.
  std::string user = value_of(each->front(), "user");
  user.erase(std::min(user.find('?'), user.size()));
  std::string hosts;
  for (const PostgresSettings& one : *each) hosts += (hosts.empty() ? "" : ",") + host_of(one);
  const std::string database = value_of(each->front(), "dbname");
  return fmt::format("postgresql://{}{}{}{}", user.empty() ? "" : user + "@", hosts,
                     database.empty() ? "" : "/", database);
}

}  // namespace trammel
