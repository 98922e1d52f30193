#include <fmt/format.h>

#include <array>
#include <optional>

#include "clients/cam/fanuc/fanuc.h"

namespace trammel::cam::fanuc {

namespace {

constexpr std::size_t kNumbers = 6;
constexpr std::array<const char*, kNumbers> kNames = {"X", "Y", "Z", "W", "P", "R"};

/// An element that is being read.
struct Element {
  std::string name;
  int line = 0;
  std::array<std::optional<double>, kNumbers> numbers;
};

void add(const Element& element, const std::string& file, ListedValues& frames) {
  std::vector<double> numbers;
  for (const std::optional<double>& number : element.numbers) {
    if (!number) return;
    numbers.push_back(*number);
  }
  frames.add(element.name,
             {pose_of(Coordinates::kAnglesXyz, numbers), std::nullopt, file, element.line});
}

/// `[*SYSTEM*]$MNUFRAME  Storage: ...`: how its elements are called; empty: another variable.
std::string called_by(const Tokens& line) {
  for (const Token token : line) {
    if (token.is("$MNUFRAME")) return "UFRAME";
    if (token.is("$MNUTOOL")) return "UTOOL";
  }
  return "";
}

class File {
 public:
  File(const SourceFile& file, ListedValues& frames) : file_(file), frames_(frames) {}

  void read() {
    for (const TokenLine& line : token_lines(file_.text, {"", "'"})) take(line.tokens);
    close();
  }

 private:
  void close() {
    if (!element_.name.empty()) add(element_, file_.name, frames_);
    element_ = {};
  }

  void take(const Tokens& line) {
    if (line[0].is("[") && line[1].is("*")) {
      close();
      variable_ = called_by(line);
    }
    if (variable_.empty()) return;
    // `[1,2] =`
    if (line.size() > 5 && line[0].is("[") && line[1].is_number() && line[2].is(",")) {
      close();
      if (line[1].is("1"))
        element_ = {fmt::format("{}[{}]", variable_, line[3].text), line[0].line, {}};
      return;
    }
    if (element_.name.empty()) return;
    for (std::size_t at = 0; at + 2 < line.size(); ++at) {
      for (std::size_t k = 0; k < kNumbers; ++k) {
        const bool said =
            line[at].is(kNames[k]) && line[at + 1].is(":") && line[at + 2].is_number();
        const auto number = said && !element_.numbers[k] ? number_in(line[at + 2]) : std::nullopt;
        if (number) element_.numbers[k] = number->value;
      }
    }
  }

  const SourceFile& file_;
  ListedValues& frames_;
  std::string variable_;
  Element element_;
};

}  // namespace

ListedValues system_frames(const std::vector<SourceFile>& files) {
  ListedValues frames;
  for (const SourceFile& file : files) File(file, frames).read();
  return frames;
}

}  // namespace trammel::cam::fanuc
