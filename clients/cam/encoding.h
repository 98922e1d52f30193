#pragma once

#include <string>
#include <string_view>

/// How the letters of a program's file are stored. Readers take bytes of which ASCII letters are
/// one each; a file in UTF-16 is turned into UTF-8 for them, and back where it is written.
namespace trammel::cam {

enum class Encoding {
  kBytes,  ///< UTF-8, or any other whose ASCII letters are one byte each
  kUtf16Little,
  kUtf16Big
};

/// By its mark, or by the zeros beside its first letters.
[[nodiscard]] Encoding encoding_of(std::string_view bytes);

struct DecodedText {
  std::string text;
  Encoding encoding = Encoding::kBytes;
};
/// A text in UTF-16 as UTF-8, its mark included. Text that cannot be turned back into the same
/// bytes (half a letter, a lone surrogate, a zero) stays as it is.
[[nodiscard]] DecodedText decoded(std::string bytes);
/// The reverse.
[[nodiscard]] std::string encoded(const std::string& text, Encoding encoding);

}  // namespace trammel::cam
