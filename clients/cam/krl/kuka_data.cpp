#include <fmt/format.h>

#include <deque>

#include "clients/cam/keep.h"
#include "clients/cam/krl/krl.h"
#include "clients/cam/krl/lines.h"
#include "clients/cam/krl/machine_arm.h"
#include "clients/cam/krl/stated.h"
#include "clients/cam/krl/tools.h"
#include "clients/cam/krl/variables.h"
#include "server/base/plain_text.h"
#include "server/base/units.h"

namespace trammel::cam {

namespace {

using krl::Told;

constexpr int kMostNumbered = 128;  // tools, bases
constexpr int kAxes = 6;

class KukaDataReader {
 public:
  explicit KukaDataReader(const std::vector<SourceFile>& files) { program_.files = files; }

  KukaData read() {
    for (std::size_t f = 0; f < program_.files.size(); ++f) collect(f);
    names_.join_globals();
    krl::read_stated(lines_, options_, names_, program_);
    for (int number = 1; number <= kMostNumbered; ++number) {
      read_tool(number);
      read_base(number);
    }
    read_limits();
    read_arm();
    data_.stated = program_;
    for (std::string& note : program_.notes) data_.notes.push_back(std::move(note));
    return std::move(data_);
  }

 private:
  void collect(std::size_t f) {
    const std::string& text = program_.files[f].text;
    lines_.push_back(krl::lines_of(text, capitals_.emplace_back(upper(text))));
    for (std::size_t k = 0; k < lines_[f].size(); ++k) {
      names_.note_value(f, k);
      note_name(f, lines_[f][k].tokens);
    }
  }

  /// `TOOL_NAME[1,]="spindle"`, `TOOL_TYPE[2]=#TCP`
  void note_name(std::size_t f, const Tokens& tokens) {
    const bool is_tool = tokens[0].is("TOOL_NAME");
    const int number = static_cast<int>(value_in(tokens[2]));
    const Token last = tokens.back();
    if ((is_tool || tokens[0].is("BASE_NAME")) && last.is_text() && last.text.size() > 2)
      (is_tool ? tool_names_ : base_names_)[number] =
          program_.files[f].text.substr(last.begin + 1, last.text.size() - 2);
    if (tokens[0].is("TOOL_TYPE") && last.is("TCP")) standing_.insert(number);
  }

  static std::string called(const std::map<int, std::string>& names, int number,
                            const std::string& otherwise) {
    const auto named = names.find(number);
    return named == names.end() ? otherwise : named->second;
  }

  /// A tool or base without a name and with a zero frame was never set.
  void read_tool(int number) {
    const std::string data = fmt::format("TOOL_DATA[{}]", number);
    if (!names_.is_set(data, 0)) return;
    ProgramTool tool = program_.tools[tools_.tool_numbered(number, 0)];
    tool.name = called(tool_names_, number, fmt::format("tool_{}", number));
    if (standing_.contains(number))
      tool.why_not = "the tool stands and the robot holds the work piece";
    if (!tool.why_not.empty()) {
      data_.notes.push_back(
          fmt::format("{} ({}) is left out: {}", data, shown(tool.name), tool.why_not));
    } else if (tool_names_.contains(number) || !same_place(*tool.X_FT, Pose::Identity())) {
      data_.tools.emplace(number, std::move(tool));
    }
  }

  void read_base(int number) {
    const std::string data = fmt::format("BASE_DATA[{}]", number);
    if (!names_.is_set(data, 0)) return;
    ProgramFrame base = program_.frames[tools_.base_numbered(number, 0)];
    base.name = data;
    if (!base.why_not.empty()) {
      data_.notes.push_back(fmt::format("{} is left out: {}", data, base.why_not));
    } else if (base_names_.contains(number) || !same_place(base.X_BO, Pose::Identity())) {
      base.X_BO = names_.robroot().inverse() * base.X_BO;
      data_.bases.emplace(number, std::move(base));
    }
  }

  void read_limits() {
    const auto end_of = [&](const char* name, int axis) -> std::optional<double> {
      const auto value = names_.value_of(fmt::format("{}[{}]", name, axis), 0);
      const bool said = value && (*value)->operands.size() == 1 &&
                        (*value)->operands[0].kind == krl::Value::Kind::kNumber;
      return said ? std::optional<double>(from_deg((*value)->operands[0].number)) : std::nullopt;
    };
    for (int axis = 1; axis <= kAxes; ++axis) {
      const auto lower = end_of("$SOFTN_END", axis), upper = end_of("$SOFTP_END", axis);
      if (!lower || !upper) return data_.limits.clear();
      data_.limits.emplace_back(*lower, *upper);
    }
  }

  void read_arm() {
    std::string name = program_.types.empty() ? "arm" : program_.types.front().type;
    name.erase(0, name.find_first_not_of("# "));
    krl::Told<Chain> arm = krl::machine_arm(lines_, names_, "KUKA " + name, data_.limits);
    if (arm)
      data_.arm = std::move(*arm);
    else
      data_.why_no_arm = arm.error();
  }

  ReadOptions options_;
  Program program_;
  std::deque<std::string> capitals_;
  std::vector<std::vector<krl::Line>> lines_;
  krl::Variables names_{program_.files, lines_};
  krl::Tools tools_{lines_, names_, options_, program_};
  std::map<int, std::string> tool_names_, base_names_;
  std::set<int> standing_;  ///< tools that the robot does not hold
  KukaData data_;
};

}  // namespace

KukaData read_kuka_data(const std::vector<SourceFile>& files) {
  return KukaDataReader(files).read();
}

}  // namespace trammel::cam
