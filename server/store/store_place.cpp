#include "server/store/store_place.h"

#include <algorithm>
#include <array>

namespace trammel {
namespace {

constexpr std::array<std::string_view, 2> kSchemes = {"postgresql://", "postgres://"};

}  // namespace

bool is_postgres_url(std::string_view place) {
  return std::any_of(kSchemes.begin(), kSchemes.end(),
                     [&](auto scheme) { return place.starts_with(scheme); });
}

std::string spoken_place(const std::string& place) {
  if (!is_postgres_url(place)) return place;
  const std::size_t begin = place.find("://") + 3;
  std::string rest = place.substr(begin);
  // As libpq looks for them: before the first '/', at the first '@'. What is behind a '?' is no
  // name, either.
  std::size_t host = rest.find_first_of("@/");
  if (host != std::string::npos && rest[host] == '/') host = std::string::npos;
  std::string user = host == std::string::npos ? "" : rest.substr(0, host);
  if (host != std::string::npos) rest.erase(0, host + 1);
  user = user.substr(0, user.find_first_of(":?"));
  return "postgresql://" + (user.empty() ? "" : user + "@") + rest.substr(0, rest.find('?'));
}

}  // namespace trammel
