#include "clients/cam/mark.h"

#include <fmt/format.h>

#include "server/base/hash.h"
#include "server/base/plain_text.h"

namespace trammel::cam {

namespace {

constexpr std::string_view kBegin = "TRAMMEL model=";
constexpr std::size_t kFarthest = 400;  // bytes from the begin of a mark to its last word

bool is_word(char c) {
  return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '.' ||
         c == '-' || c == '_';
}

std::string value_of(std::string_view text, std::string_view key) {
  const std::size_t at = text.find(key);
  if (at == std::string_view::npos) return "";
  std::size_t end = at + key.size();
  while (end < text.size() && is_word(text[end])) ++end;
  return std::string(text.substr(at + key.size(), end - at - key.size()));
}

}  // namespace

std::string short_hash(std::string_view bytes) { return sha256_hex(bytes).substr(0, 16); }

std::vector<std::string> words_of(const Mark& mark) {
  return {"TRAMMEL model=" + mark.model, "version=" + mark.version, "date=" + mark.date,
          "original=" + mark.original};
}

std::string mark_text(const Mark& mark) {
  return fmt::format("it is corrected already, by model {} on {}", shown_short(mark.model),
                     shown_short(mark.date));
}

std::optional<Mark> find_mark(std::string_view text) {
  const std::size_t at = text.find(kBegin);
  if (at == std::string_view::npos) return std::nullopt;
  const std::string_view near = text.substr(at, kFarthest);
  return Mark{value_of(near, "model="), value_of(near, "version="), value_of(near, "date="),
              value_of(near, "original=")};
}

std::string original_path(const std::string& path) { return path + ".original"; }

}  // namespace trammel::cam
