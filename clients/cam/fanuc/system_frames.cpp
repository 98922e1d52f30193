#include "clients/cam/fanuc/system_frames.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <optional>

#include "clients/cam/scan.h"

namespace trammel::cam::fanuc {

namespace {

using Frames = std::map<std::string, SystemFrame>;

constexpr std::size_t kNumbers = 6;
constexpr std::array<const char*, kNumbers> kNames = {"X", "Y", "Z", "W", "P", "R"};

/// An element that is being read.
struct Element {
  std::string name;
  int line = 0;
  std::array<std::optional<double>, kNumbers> numbers;
};

void add(const Element& element, const std::string& file, Frames& frames) {
  std::vector<double> numbers;
  for (const std::optional<double>& number : element.numbers) {
    if (!number) return;
    numbers.push_back(*number);
  }
  const Pose X = pose_of(Coordinates::kAnglesXyz, numbers);
  const auto [known, fresh] =
      frames.try_emplace(element.name, SystemFrame{X, file, element.line, ""});
  SystemFrame& first = known->second;
  if (!fresh && first.why_not.empty() && !same_place(first.X, X))
    first.why_not =
        fmt::format("{} has two values: {} ({} line {}), {} ({} line {})", element.name,
                    pose_text(first.X), first.file, first.line, pose_text(X), file, element.line);
}

/// `[*SYSTEM*]$MNUFRAME  Storage: ...`: how its elements are called; empty: another variable.
std::string called_by(const std::vector<Piece>& line) {
  for (const Piece& piece : line) {
    if (piece.is("$MNUFRAME")) return "UFRAME";
    if (piece.is("$MNUTOOL")) return "UTOOL";
  }
  return "";
}

class File {
 public:
  File(const SourceFile& file, Frames& frames) : file_(file), frames_(frames) {}

  void read() {
    const std::string& text = file_.text;
    int number = 1;
    for (std::size_t at = 0; at < text.size(); ++number) {
      const std::size_t end = std::min(text.find('\n', at), text.size());
      take(pieces_of(text, at, end, number, {"", "'"}));
      at = end + 1;
    }
    close();
  }

 private:
  void close() {
    if (!element_.name.empty()) add(element_, file_.name, frames_);
    element_ = {};
  }

  void take(const std::vector<Piece>& line) {
    if (line.size() > 1 && line[0].is("[") && line[1].is("*")) {
      close();
      variable_ = called_by(line);
    }
    if (variable_.empty()) return;
    // `[1,2] =`
    if (line.size() > 5 && line[0].is("[") && line[1].kind == Piece::Kind::kNumber &&
        line[2].is(",")) {
      close();
      if (line[1].is("1"))
        element_ = {fmt::format("{}[{}]", variable_, line[3].text), line[0].line, {}};
      return;
    }
    if (element_.name.empty()) return;
    for (std::size_t at = 0; at + 2 < line.size(); ++at) {
      for (std::size_t k = 0; k < kNumbers; ++k) {
        const bool said = line[at].is(kNames[k]) && line[at + 1].is(":") &&
                          line[at + 2].kind == Piece::Kind::kNumber;
        const auto number =
            said && !element_.numbers[k] ? read_number(line[at + 2].text) : std::nullopt;
        if (number) element_.numbers[k] = number->value;
      }
    }
  }

  const SourceFile& file_;
  Frames& frames_;
  std::string variable_;
  Element element_;
};

}  // namespace

Frames system_frames(const std::vector<SourceFile>& files) {
  Frames frames;
  for (const SourceFile& file : files) File(file, frames).read();
  return frames;
}

}  // namespace trammel::cam::fanuc
