#include "server/http/tokens.h"

#include <openssl/evp.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <set>
#include <sstream>
#include <utility>

#include "server/base/hash.h"
#include "server/base/name_check.h"
#include "server/base/text_file.h"

namespace trammel {
namespace {

constexpr std::array kRoles = {"observer", "cam", "metrologist", "engineer"};  // of Role
constexpr std::size_t kHashLetters = 64;
constexpr std::size_t kLongestName = 64;

std::optional<Role> role_called(const std::string& word) {
  const auto found = std::find(kRoles.begin(), kRoles.end(), word);
  if (found == kRoles.end()) return std::nullopt;
  return static_cast<Role>(found - kRoles.begin());
}

bool is_hash(const std::string& word) {
  return word.size() == kHashLetters &&
         word.find_first_not_of("0123456789abcdef") == std::string::npos;
}

bool is_plain_name(const std::string& name) {
  return name.size() <= kLongestName &&
         name.find_first_not_of(
             "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789._-") ==
             std::string::npos;
}

struct TokenLine {
  std::string hash;
  Asker asker;
};

Result<TokenLine> token_line(const std::string& line) {
  std::istringstream words(line);
  std::string name, role, hash, more;
  words >> name >> role >> hash >> more;
  const auto known = role_called(role);
  if (!is_plain_name(name))
    return refused("the name must have 1 to {} letters, digits, `.`, `_`, `-`", kLongestName)
        .of("name")
        .with_text(name);
  if (!known)
    return refused("role '{}', expected observer, cam, metrologist or engineer", role)
        .of("role")
        .with_text(role);
  if (!is_hash(hash) || !more.empty())
    return refused("expected NAME ROLE SHA-256, the hash in 64 small hexadecimal digits")
        .of("hash");
  return TokenLine{hash, {name, *known}};
}

Status check_private(const std::string& path) {
  struct stat file {};
  if (::stat(path.c_str(), &file) != 0 || (file.st_mode & S_IRWXO) == 0) return {};
  return refused("others than its owner and group may read it").in(path).next("chmod o= " + path);
}

}  // namespace

const char* to_text(Role role) { return kRoles[static_cast<std::size_t>(role)]; }

Result<Tokens> Tokens::read(const std::string& path) {
  TRY(check_private(path));
  std::istringstream lines(TRY(read_text_file(path)));
  Tokens tokens;
  std::set<std::string> names;
  std::vector<Error> problems;
  std::string line;
  for (long row = 1; std::getline(lines, line); ++row) {
    line = line.substr(0, line.find('#'));
    if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
    auto read = token_line(line);
    if (read && (!names.insert(read->asker.name).second || tokens.by_hash_.contains(read->hash)))
      read = refused("a name or a token that occurs twice").of("name").with_text(read->asker.name);
    if (read) {
      tokens.by_hash_[read->hash] = read->asker;
    } else {
      Error problem = read.error();
      problem.file = path;
      problem.row = row;
      problems.push_back(std::move(problem));
    }
  }
  if (!problems.empty()) return tl::make_unexpected(together(std::move(problems)));
  if (tokens.by_hash_.empty()) return refused("no token in it").in(path);
  return tokens;
}

std::optional<Asker> Tokens::asker_of(const std::string& authorization) const {
  const std::string kBearer = "Bearer ", kBasic = "Basic ";
  std::string token, name;
  if (authorization.starts_with(kBearer)) {
    token = authorization.substr(kBearer.size());
  } else if (authorization.starts_with(kBasic)) {
    const auto pair = from_base64(authorization.substr(kBasic.size()));
    if (!pair) return std::nullopt;
    const std::size_t colon = pair->find(':');
    if (colon == std::string::npos) return std::nullopt;
    name = pair->substr(0, colon);
    token = pair->substr(colon + 1);
  }
  // Who compares hashes gives away nothing of a token by the time that it takes.
  const auto found = token.empty() ? by_hash_.end() : by_hash_.find(sha256_hex(token));
  if (found == by_hash_.end() || (!name.empty() && name != found->second.name)) return std::nullopt;
  return found->second;
}

std::optional<std::string> from_base64(const std::string& text) {
  if (text.size() % 4 != 0) return std::nullopt;
  if (text.empty()) return std::string();
  std::string bytes(text.size() / 4 * 3, '\0');
  const int size = ::EVP_DecodeBlock(reinterpret_cast<unsigned char*>(bytes.data()),
                                     reinterpret_cast<const unsigned char*>(text.data()),
                                     static_cast<int>(text.size()));
  if (size < 0) return std::nullopt;
  const std::size_t padding = text.ends_with("==") ? 2 : text.ends_with('=') ? 1 : 0;
  bytes.resize(static_cast<std::size_t>(size) - padding);
  return bytes;
}

std::string to_base64(const std::string& bytes) {
  std::string text((bytes.size() + 2) / 3 * 4 + 1, '\0');  // with a zero at the end
  const int size = ::EVP_EncodeBlock(reinterpret_cast<unsigned char*>(text.data()),
                                     reinterpret_cast<const unsigned char*>(bytes.data()),
                                     static_cast<int>(bytes.size()));
  text.resize(static_cast<std::size_t>(size));
  return text;
}

}  // namespace trammel
