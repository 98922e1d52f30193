#include "clients/cam/inform/conditions.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "clients/cam/number_text.h"
#include "clients/cam/scan.h"
#include "server/base/units.h"

namespace trammel::cam::inform {

namespace {

using Conditions = std::map<std::string, Condition>;

/// The numbers of a line; empty: something else stands in it.
std::vector<double> numbers_in(const std::vector<Piece>& line) {
  std::vector<double> numbers;
  for (const Piece& piece : line) {
    const auto number = piece.kind == Piece::Kind::kNumber ? read_number(piece.text) : std::nullopt;
    if (!number && !piece.is(",")) return {};
    if (number) numbers.push_back(number->value);
  }
  return numbers;
}

/// Reads one file line by line. Of a tool its pose comes first, then its centre of gravity (mm),
/// then its mass (kg).
class File {
 public:
  File(const SourceFile& file, Conditions& all) : file_(file), all_(all) {}

  void read() {
    const std::string& text = file_.text;
    int number = 1;
    for (std::size_t at = 0; at < text.size(); ++number) {
      const std::size_t end = std::min(text.find('\n', at), text.size());
      take(std::string_view(text).substr(at, end - at), pieces_of(text, at, end, number, {}),
           number);
      at = end + 1;
    }
    close();
  }

 private:
  /// `//TOOL 0`, `//UFRAME 1`, `////BUSER 900.0,0,0,0,0,0`,
  /// `0.000,0.000,300.000,0.0000,0.0000,0.0000`
  void take(std::string_view line, const std::vector<Piece>& pieces, int number) {
    if (line.starts_with("//") && !line.starts_with("///")) {
      close();
      for (const auto& [word, called] :
           {std::pair("//TOOL ", "TOOL"), std::pair("//UFRAME ", "USER")}) {
        if (line.starts_with(word) && !pieces.empty() && pieces.back().kind == Piece::Kind::kNumber)
          name_ = fmt::format("{}[{}]", called, pieces.back().text);
      }
      is_tool_ = name_.starts_with("TOOL");
      return;
    }
    if (name_.empty()) return;
    constexpr std::string_view kOfUser = "////BUSER";
    if (!is_tool_ && line.starts_with(kOfUser)) {
      const std::vector<Piece> behind(
          std::find_if(pieces.begin(), pieces.end(),
                       [](const Piece& p) { return p.kind == Piece::Kind::kNumber; }),
          pieces.end());
      take_numbers(numbers_in(behind), number);
    } else if (is_tool_ && !line.starts_with("/")) {
      take_numbers(numbers_in(pieces), number);
    }
  }
  void take_numbers(std::vector<double> numbers, int line) {
    if (numbers.empty()) return;
    if (told_.empty()) line_ = line;
    told_.push_back(std::move(numbers));
  }

  void close() {
    const std::string name = std::exchange(name_, {});
    const std::vector<std::vector<double>> told = std::exchange(told_, {});
    if (name.empty() || told.empty() || told[0].size() < 6) return;
    Condition one{pose_of(Coordinates::kAnglesXyz, told[0]), {}, file_.name, line_, ""};
    if (told.size() > 2 && told[1].size() == 3 && told[2].size() == 1) {
      const Vector3 centre(told[1][0], told[1][1], told[1][2]);
      one.load = StatedLoad{told[2][0], centre * from_mm(1)};
    }
    const auto [known, is_new] = all_.try_emplace(name, one);
    Condition& first = known->second;
    if (!is_new && first.why_not.empty() && !same_place(first.X, one.X))
      first.why_not = fmt::format("{} has two values: {} ({} line {}), {} ({} line {})", name,
                                  pose_text(first.X), first.file, first.line, pose_text(one.X),
                                  one.file, one.line);
  }

  const SourceFile& file_;
  Conditions& all_;
  std::string name_;  ///< of what is read; empty: nothing that is wanted
  bool is_tool_ = false;
  int line_ = 0;                           ///< of its pose
  std::vector<std::vector<double>> told_;  ///< its lines of numbers
};

}  // namespace

Conditions conditions(const std::vector<SourceFile>& files) {
  Conditions all;
  for (const SourceFile& file : files) File(file, all).read();
  return all;
}

}  // namespace trammel::cam::inform
