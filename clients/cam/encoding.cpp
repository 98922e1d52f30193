#include "clients/cam/encoding.h"

#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>

namespace trammel::cam {

namespace {

constexpr std::uint32_t kFirstHigh = 0xD800, kFirstLow = 0xDC00, kBehindLow = 0xE000;
constexpr std::uint32_t kFirstOfPairs = 0x10000;

std::uint32_t byte_at(std::string_view text, std::size_t at) {
  return static_cast<unsigned char>(text[at]);
}

void add_byte(std::uint32_t byte, std::string& text) { text += static_cast<char>(byte & 0xFFu); }

void add_utf8(std::uint32_t point, std::string& text) {
  const int more = point < 0x80 ? 0 : point < 0x800 ? 1 : point < kFirstOfPairs ? 2 : 3;
  constexpr std::uint32_t kLead[] = {0, 0xC0, 0xE0, 0xF0};
  add_byte(kLead[more] | point >> (6 * more), text);
  for (int k = more - 1; k >= 0; --k) add_byte(0x80u | (point >> (6 * k) & 0x3Fu), text);
}

/// The code point that begins at a byte of UTF-8; `at` goes behind it. A byte that begins no such
/// sequence is a character by itself.
std::uint32_t next_point(std::string_view text, std::size_t& at) {
  const std::uint32_t lead = byte_at(text, at++);
  const int more = lead < 0xC0 ? 0 : lead < 0xE0 ? 1 : lead < 0xF0 ? 2 : 3;
  std::uint32_t point = more == 0 ? lead : lead & (0x3Fu >> more);
  for (int k = 0; k < more && at < text.size(); ++k)
    point = point << 6 | (byte_at(text, at++) & 0x3Fu);
  return point;
}

std::optional<std::string> utf8_of(std::string_view bytes, bool big) {
  if (bytes.size() % 2 != 0) return std::nullopt;
  const auto unit = [&](std::size_t at) {
    return byte_at(bytes, big ? at : at + 1) << 8 | byte_at(bytes, big ? at + 1 : at);
  };
  std::string text;
  text.reserve(bytes.size() / 2);
  for (std::size_t at = 0; at < bytes.size(); at += 2) {
    std::uint32_t point = unit(at);
    if (point == 0 || (point >= kFirstLow && point < kBehindLow)) return std::nullopt;
    if (point >= kFirstHigh && point < kFirstLow) {
      at += 2;
      const std::uint32_t low = at < bytes.size() ? unit(at) : 0;
      if (low < kFirstLow || low >= kBehindLow) return std::nullopt;
      point = kFirstOfPairs + ((point - kFirstHigh) << 10 | (low - kFirstLow));
    }
    add_utf8(point, text);
  }
  return text;
}

}  // namespace

Encoding encoding_of(std::string_view bytes) {
  if (bytes.starts_with("\xFF\xFE")) return Encoding::kUtf16Little;
  if (bytes.starts_with("\xFE\xFF")) return Encoding::kUtf16Big;
  if (bytes.size() < 4) return Encoding::kBytes;
  const auto zeros = [&](std::size_t first) {
    return bytes[first] == '\0' && bytes[first + 2] == '\0';
  };
  if (zeros(0) == zeros(1)) return Encoding::kBytes;
  return zeros(0) ? Encoding::kUtf16Big : Encoding::kUtf16Little;
}

DecodedText decoded(std::string bytes) {
  const Encoding encoding = encoding_of(bytes);
  if (encoding == Encoding::kBytes) return {std::move(bytes), encoding};
  std::optional<std::string> text = utf8_of(bytes, encoding == Encoding::kUtf16Big);
  if (!text) return {std::move(bytes), Encoding::kBytes};
  return {std::move(*text), encoding};
}

std::string encoded(const std::string& text, Encoding encoding) {
  if (encoding == Encoding::kBytes) return text;
  std::string bytes;
  bytes.reserve(2 * text.size());
  const auto add_unit = [&](std::uint32_t unit) {
    const bool big = encoding == Encoding::kUtf16Big;
    add_byte(big ? unit >> 8 : unit, bytes);
    add_byte(big ? unit : unit >> 8, bytes);
  };
  for (std::size_t at = 0; at < text.size();) {
    const std::uint32_t point = next_point(text, at);
    if (point < kFirstOfPairs) {
      add_unit(point);
      continue;
    }
    add_unit(kFirstHigh + ((point - kFirstOfPairs) >> 10));
    add_unit(kFirstLow + ((point - kFirstOfPairs) & 0x3FFu));
  }
  return bytes;
}

}  // namespace trammel::cam
