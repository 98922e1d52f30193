#pragma once

#include <string>
#include <vector>

#include "clients/cam/program.h"

namespace trammel::cam {

/// Changes of one text, in any order. Bytes outside of them stay.
class Edits {
 public:
  void replace(Span span, std::string text) { replacements_.push_back({span, std::move(text)}); }
  /// Inserts a whole line above the line that begins at `at`, with the line ends of the text.
  void insert_line(std::size_t at, std::string line) { lines_.push_back({at, std::move(line)}); }
  [[nodiscard]] bool empty() const { return replacements_.empty() && lines_.empty(); }

  struct Applied {
    std::string text;
    struct Line {
      int number = 0;  ///< in the new text, from 1
      std::string text;
    };
    std::vector<Line> inserted;
  };
  /// Uses them up.
  [[nodiscard]] Applied apply(const std::string& text) &&;

 private:
  struct Replacement {
    Span span;
    std::string text;
  };
  struct Line {
    std::size_t at = 0;
    std::string text;
  };
  std::vector<Replacement> replacements_;
  std::vector<Line> lines_;
};

/// `\r\n` or `\n`, whichever the text's first line ends in.
[[nodiscard]] std::string line_end_of(const std::string& text);

}  // namespace trammel::cam
