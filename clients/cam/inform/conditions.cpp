#include <fmt/format.h>

#include <utility>

#include "clients/cam/inform/inform.h"
#include "server/base/units.h"

namespace trammel::cam::inform {

namespace {

/// The numbers of tokens from one on; empty: something else stands among them.
std::vector<double> numbers_from(const Tokens& line, std::size_t first) {
  std::vector<double> numbers;
  for (std::size_t at = first; at < line.size(); ++at) {
    const auto number = line[at].is_number() ? number_in(line[at]) : std::nullopt;
    if (!number && !line[at].is(",")) return {};
    if (number) numbers.push_back(number->value);
  }
  return numbers;
}

/// Reads one file line by line. Of a tool its pose comes first, then its centre of gravity (mm),
/// then its mass (kg).
class File {
 public:
  File(const SourceFile& file, ListedValues& all) : file_(file), all_(all) {}

  void read() {
    for (const TokenLine& line : token_lines(file_.text, {}))
      take(std::string_view(file_.text).substr(line.begin, line.end - line.begin), line.tokens,
           line.number);
    close();
  }

 private:
  /// `//TOOL 0`, `//UFRAME 1`, `////BUSER 900.0,0,0,0,0,0`,
  /// `0.000,0.000,300.000,0.0000,0.0000,0.0000`
  void take(std::string_view line, const Tokens& tokens, int number) {
    if (line.starts_with("//") && !line.starts_with("///")) {
      close();
      for (const auto& [word, called] :
           {std::pair("//TOOL ", "TOOL"), std::pair("//UFRAME ", "USER")}) {
        if (line.starts_with(word) && tokens.back().is_number())
          name_ = fmt::format("{}[{}]", called, tokens.back().text);
      }
      is_tool_ = name_.starts_with("TOOL");
      return;
    }
    if (name_.empty()) return;
    constexpr std::string_view kOfUser = "////BUSER";
    if (!is_tool_ && line.starts_with(kOfUser)) {
      std::size_t first = 0;
      while (first < tokens.size() && !tokens[first].is_number()) ++first;
      take_numbers(numbers_from(tokens, first), number);
    } else if (is_tool_ && !line.starts_with("/")) {
      take_numbers(numbers_from(tokens, 0), number);
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
    ListedValue one{pose_of(Coordinates::kAnglesXyz, told[0]), {}, file_.name, line_};
    if (told.size() > 2 && told[1].size() == 3 && told[2].size() == 1) {
      const Vector3 centre(told[1][0], told[1][1], told[1][2]);
      one.load = StatedLoad{told[2][0], centre * from_mm(1)};
    }
    all_.add(name, std::move(one));
  }

  const SourceFile& file_;
  ListedValues& all_;
  std::string name_;  ///< the name of the current entry; empty: it is not needed
  bool is_tool_ = false;
  int line_ = 0;                           ///< of its pose
  std::vector<std::vector<double>> told_;  ///< its lines of numbers
};

}  // namespace

ListedValues conditions(const std::vector<SourceFile>& files) {
  ListedValues all;
  for (const SourceFile& file : files) File(file, all).read();
  return all;
}

}  // namespace trammel::cam::inform
