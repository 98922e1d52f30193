#include "server/base/plain_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <iterator>

namespace trammel {
namespace {

/// A character and its length in bytes; 0 bytes where the text does not start with one.
struct Character {
  std::uint32_t code = 0;
  std::size_t bytes = 0;
};

Character first_character(std::string_view text) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned char lead = byte(0);
  if (lead != 0 && lead < 0x80) return {lead, 1};
  const std::size_t length = lead >= 0xC2 && lead < 0xE0   ? 2
                             : lead >= 0xE0 && lead < 0xF0 ? 3
                             : lead >= 0xF0 && lead < 0xF5 ? 4
                                                           : 0;
  if (length == 0 || length > text.size()) return {};
  std::uint32_t code = lead & (0x7Fu >> length);
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte(i) & 0xC0) != 0x80) return {};
    code = code << 6 | (byte(i) & 0x3Fu);
  }
  const bool overlong = (length == 3 && code < 0x800) || (length == 4 && code < 0x10000);
  const bool surrogate_or_beyond = (code >= 0xD800 && code < 0xE000) || code > 0x10FFFF;
  if (overlong || surrogate_or_beyond) return {};
  return {code, length};
}

bool controls(std::uint32_t code) {
  return code < 0x20 || (code >= 0x7F && code < 0xA0) || (code >= 0x2028 && code <= 0x202E) ||
         (code >= 0x2066 && code <= 0x2069) || code == 0x200E || code == 0x200F || code == 0x061C ||
         code == 0xFEFF;
}

/// True for the Unicode property Default_Ignorable_Code_Point, which fonts do not draw, and for
/// noncharacters.
bool is_unseen(std::uint32_t code) {
  struct Range {
    std::uint32_t first, last;
  };
  constexpr Range kUnseen[] = {
      {0x00AD, 0x00AD},   {0x034F, 0x034F},   {0x061C, 0x061C},  {0x115F, 0x1160}, {0x17B4, 0x17B5},
      {0x180B, 0x180F},   {0x200B, 0x200F},   {0x202A, 0x202E},  {0x2060, 0x206F}, {0x3164, 0x3164},
      {0xFDD0, 0xFDEF},   {0xFE00, 0xFE0F},   {0xFEFF, 0xFEFF},  {0xFFA0, 0xFFA0}, {0xFFF0, 0xFFFB},
      {0x1BCA0, 0x1BCA3}, {0x1D173, 0x1D17A}, {0xE0000, 0xE0FFF}};
  if ((code & 0xFFFE) == 0xFFFE) return true;
  return std::any_of(std::begin(kUnseen), std::end(kUnseen), [code](const Range& range) {
    return code >= range.first && code <= range.last;
  });
}

bool ends_line_or_field(std::uint32_t code) { return code == '\t' || code == '\n' || code == '\r'; }

template <typename Allowed>
bool all_of_characters(std::string_view text, const Allowed& allowed) {
  while (!text.empty()) {
    const Character next = first_character(text);
    if (next.bytes == 0 || !allowed(next.code)) return false;
    text.remove_prefix(next.bytes);
  }
  return true;
}

/// `text` with every character that is not `allowed` spelled out.
template <typename Allowed>
std::string spelled_out(std::string_view text, const Allowed& allowed) {
  std::string out;
  out.reserve(text.size());
  while (!text.empty()) {
    const Character next = first_character(text);
    const bool nul = text.front() == '\0';
    if (next.bytes == 0 && !nul) {
      out += fmt::format("\\x{:02x}", static_cast<unsigned char>(text.front()));
    } else if (nul || !allowed(next.code)) {
      out += fmt::format("\\u{:04x}", next.code);
    } else {
      out += text.substr(0, next.bytes);
    }
    text.remove_prefix(std::max<std::size_t>(next.bytes, 1));
  }
  return out;
}

}  // namespace

bool is_utf8(std::string_view text) {
  return all_of_characters(text, [](std::uint32_t) { return true; });
}

bool is_plain(std::string_view text) {
  return all_of_characters(text,
                           [](std::uint32_t code) { return !controls(code) && !is_unseen(code); });
}

bool is_plain_lines(std::string_view text) {
  return all_of_characters(
      text, [](std::uint32_t code) { return !controls(code) || ends_line_or_field(code); });
}

std::string shown(std::string_view text) {
  return spelled_out(text, [](std::uint32_t code) { return !controls(code) && !is_unseen(code); });
}

std::string shown_lines(std::string_view text) {
  return spelled_out(text, [](std::uint32_t code) {
    return (!controls(code) && !is_unseen(code)) || code == '\t' || code == '\n';
  });
}

std::string shown_short(std::string_view text, std::size_t most_bytes) {
  if (text.size() <= most_bytes) return shown(text);
  // A character that the cut would split goes whole.
  while (most_bytes > 0 && (static_cast<unsigned char>(text[most_bytes]) & 0xC0) == 0x80)
    --most_bytes;
  return shown(text.substr(0, most_bytes)) + "...";
}

}  // namespace trammel
