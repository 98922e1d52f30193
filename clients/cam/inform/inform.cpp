#include "clients/cam/inform/inform.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <set>

#include "clients/cam/flow.h"
#include "clients/cam/inform/conditions.h"
#include "clients/cam/scan.h"
#include "clients/cam/sites.h"
#include "server/base/plain_text.h"
#include "server/base/units.h"

namespace trammel::cam {

namespace {

struct Position {
  std::size_t begin = 0;
  int line = 1;
  std::string kind, tool, user;  ///< as POSTYPE, TOOL, USER stood above it
  std::vector<int> conf;         ///< RCONF
  int again_at = 0;              ///< the line of another one of that name; 0: there is none
  std::vector<Piece> numbers;
};

/// A line behind //INST.
struct Statement {
  std::size_t begin = 0, end = 0;
  int line = 1;
};

/// What moves the robot beside where motions say.
struct Displaced {
  std::string shifted;  ///< where a SFTON stands that holds; empty: none does
  std::string sensed;   ///< what a sensor or a soft axis does, as `COMARCON (drill.jbi line 7)`;
                        ///< empty: nothing
  bool operator==(const Displaced&) const = default;
};

/// What the condition files say, and the names of it that jobs use, by the file.
struct Controller {
  std::map<std::string, inform::Condition> conditions;
  std::map<std::string, std::set<std::string>> taken;

  /// nullptr: they say nothing of it.
  const inform::Condition* take(const std::string& name) {
    const auto known = conditions.find(name);
    if (known == conditions.end()) return nullptr;
    if (known->second.why_not.empty()) taken[known->second.file].insert(name);
    return &known->second;
  }
};

class Job {
 public:
  Job(std::size_t index, Program& program, Sites& sites, const ReadOptions& options,
      Controller& controller)
      : index_(index),
        program_(program),
        sites_(sites),
        options_(options),
        controller_(controller),
        text_(program.files[index].text) {}

  void read() {
    program_.mark_places.push_back({text_.size(), "'", "", true});
    bool instructions = false;
    std::size_t begin = 0;
    for (int number = 1; begin < text_.size(); ++number) {
      const std::size_t end = std::min(text_.find('\n', begin), text_.size());
      const std::string_view line = std::string_view(text_).substr(begin, end - begin);
      if (line.starts_with("//INST")) instructions = true;
      if (line.starts_with("/JOB")) jobs_at_ = number;
      if (instructions && is_end(line)) jobs_at_ = 0;
      if (line.starts_with("NOP") && instructions &&
          program_.mark_places[index_].at == text_.size())
        program_.mark_places[index_].at = std::min(end + 1, text_.size());
      if (line.starts_with("//NAME ")) name_ = value_behind(line);
      if (line.starts_with("///GROUP1 ")) group_ = value_behind(line);
      if (instructions)
        statements_.push_back({begin, end, number});
      else
        header(line, begin, end, number);
      begin = end + 1;
    }
    if (jobs_at_ > 0) program_.cuts.push_back({index_, jobs_at_, "the job has no END"});
  }

  [[nodiscard]] const std::string& name() const { return name_; }

  /// `MFRAME UF#(1) C00000 C00001 C00002`, `SETTOOL TL#(1) P010`: frames and tools that jobs set,
  /// with where.
  void note_settings(std::map<std::string, std::string>& set) const {
    for (const Statement& statement : statements_) {
      const std::vector<Piece> pieces = pieces_at(statement);
      note_frame_of_call(statement, pieces, set);
      if (pieces.size() < 4 || (!pieces[0].is("MFRAME") && !pieces[0].is("SETTOOL"))) continue;
      const bool numbered =
          pieces.size() > 5 && pieces[2].is("#") && pieces[4].kind == Piece::Kind::kNumber;
      const std::string what = fmt::format("{}[{}]", pieces[0].is("MFRAME") ? "USER" : "TOOL",
                                           numbered ? pieces[4].text : std::string_view("*"));
      set.emplace(what, fmt::format("{} is set at run time ({} line {})", what,
                                    program_.files[index_].name, statement.line));
    }
  }
  /// `CALL JOB:DRILL UF#(2)`: a relative job goes by another user frame than the one in its head.
  void note_frame_of_call(const Statement& statement, const std::vector<Piece>& pieces,
                          std::map<std::string, std::string>& set) const {
    if (pieces.size() < 4 || (!pieces[0].is("CALL") && !pieces[0].is("JUMP")) ||
        !pieces[1].is("JOB"))
      return;
    const bool frame = std::any_of(pieces.begin(), pieces.end(),
                                   [](const Piece& piece) { return piece.is("UF"); });
    if (frame)
      set.emplace(frame_of_call(word_from(pieces[3].begin)),
                  fmt::format("{} {} gives the job another user frame ({} line {})", pieces[0].text,
                              shown(word_from(pieces[3].begin)), program_.files[index_].name,
                              statement.line));
  }
  static std::string frame_of_call(const std::string& job) { return "JOB:" + job; }

  /// Of all jobs.
  void take_settings(const std::map<std::string, std::string>& set) { set_ = &set; }
  [[nodiscard]] const std::vector<Statement>& statements() const { return statements_; }

  /// What a statement does to the order. A condition behind it makes a block of it.
  [[nodiscard]] std::vector<Step> steps_of(const Statement& statement) const {
    using Kind = Step::Kind;
    static const std::map<std::string, Kind> kWords = {
        {"IFTHEN", Kind::kIf},      {"IFTHENEXP", Kind::kIf},     {"ELSEIF", Kind::kCase},
        {"ELSEIFEXP", Kind::kCase}, {"ELSE", Kind::kElse},        {"ENDIF", Kind::kEnd},
        {"WHILE", Kind::kWhile},    {"WHILEEXP", Kind::kWhile},   {"ENDWHILE", Kind::kEnd},
        {"FOR", Kind::kWhile},      {"NEXT", Kind::kEnd},         {"SWITCH", Kind::kSwitch},
        {"CASE", Kind::kCase},      {"DEFAULT", Kind::kElse},     {"ENDSWITCH", Kind::kEnd},
        {"BREAK", Kind::kExit},     {"CONTINUE", Kind::kContinue}};
    const std::vector<Piece> pieces = pieces_at(statement);
    if (pieces.empty()) return {{}};
    if (pieces[0].is("*")) return {{Kind::kLabel, word_from(pieces[0].begin)}};
    const bool maybe = std::any_of(pieces.begin() + 1, pieces.end(),
                                   [](const Piece& piece) { return piece.is("IF"); });
    if (pieces[0].is("RET") || pieces[0].is("END")) return {{maybe ? Kind::kPlain : Kind::kReturn}};
    if (pieces[0].is("JUMP") && pieces.size() > 1 && pieces[1].is("*"))
      return {{maybe ? Kind::kJumpMaybe : Kind::kJump, word_from(pieces[1].begin)}};
    if (pieces[0].is("JUMP")) return {{maybe ? Kind::kPlain : Kind::kReturn}};
    if (pieces[0].is("CALL") && pieces.size() > 3 && pieces[1].is("JOB")) {
      const Step call{Kind::kCall, word_from(pieces[3].begin)};
      return maybe ? std::vector<Step>{{Kind::kIf}, call, {Kind::kEnd}} : std::vector<Step>{call};
    }
    const auto word = kWords.find(std::string(pieces[0].text));
    return {word == kWords.end() ? Step{} : Step{word->second}};
  }

  /// `SFTON`, `SFTOF`; `COMARCON`, `COMARCOF` of the seam's sensor, and their like.
  void shift(const Statement& statement, Displaced& displaced) const {
    static const std::map<std::string_view, bool> kSensors = {
        {"COMARCON", true}, {"COMARCOF", false}, {"FLOATON", true},
        {"FLOATOF", false}, {"PMTON", true},     {"PMTOF", false}};
    const std::vector<Piece> pieces = pieces_at(statement);
    if (pieces.empty()) return;
    const std::string place =
        fmt::format("{} line {}", program_.files[index_].name, statement.line);
    if (pieces[0].is("SFTON")) displaced.shifted = place;
    if (pieces[0].is("SFTOF")) displaced.shifted.clear();
    if (const auto sensor = kSensors.find(pieces[0].text); sensor != kSensors.end())
      displaced.sensed = sensor->second ? fmt::format("{} ({})", sensor->first, place) : "";
  }

  void list_unused() {
    for (const auto& [name, position] : positions_) {
      if (!used_.contains(name) && name[0] == 'C')
        program_.left.push_back(
            {name, index_, position.line, "", "no motion in this job goes to it"});
    }
  }

  std::string describe(const Site& site, ProgramTarget& target) const {
    const Position& position = positions_.at(site.name);
    target.line = position.line;
    if (position.again_at != 0)
      return fmt::format("it stands there twice (line {}, line {})", position.line,
                         position.again_at);
    const bool in_pulses = position.kind == "PULSE";
    if (in_pulses && options_.keep_joints) return "joint targets are kept (--keep-joints)";
    if (in_pulses && options_.pulses_per_deg.empty())
      return "it is in pulses, and no file tells how many make a degree: give --pulses-per-deg "
             "S,L,U,R,B,T (jog each axis, and divide what its pulses change by on the pendant by "
             "what its angle changes by)";
    if (position.numbers.size() < 6)
      return fmt::format("it has {} numbers, 6 are due", position.numbers.size());
    target.coordinates = in_pulses ? Coordinates::kJointPulses : Coordinates::kAnglesXyz;
    if (in_pulses) target.pulses_per_deg = options_.pulses_per_deg;
    for (std::size_t k = 0; k < 6; ++k) {
      const auto written = read_number(position.numbers[k].text);
      if (!written) return "it holds what is no number";
      target.numbers.push_back(written->value);
      target.rewrites.push_back(
          {{position.numbers[k].begin, position.numbers[k].end}, {}, {{k, written->style}}});
    }
    if (!in_pulses) target.configuration = configuration_of(position.conf);
    return take_external(site, target);
  }

 private:
  static bool is_end(std::string_view line) {
    const std::size_t first = std::min(line.find_first_not_of(" \t"), line.size());
    return line.substr(first).starts_with("END") &&
           line.find_first_not_of(" \t\r", first + 3) == std::string_view::npos;
  }
  static std::string value_behind(std::string_view line) {
    const std::size_t at = line.find(' ');
    if (at == std::string_view::npos) return "";
    const std::size_t end = line.find_last_not_of(" \t\r");
    return std::string(line.substr(at + 1, end - at));
  }

  /// `C00000`, and the external axes of the same place: `BC00000` that carry the robot, `EC00000`
  /// that carry the part.
  static bool names_position(std::string_view text) {
    const std::size_t letter = !text.empty() && (text[0] == 'B' || text[0] == 'E') ? 1 : 0;
    return text.size() > letter + 1 && text[letter] == 'C' && text[letter + 1] >= '0' &&
           text[letter + 1] <= '9';
  }

  void header(std::string_view line, std::size_t begin, std::size_t end, int number) {
    if (line.starts_with("///TOOL")) now_.tool = value_behind(line);
    if (line.starts_with("///USER")) now_.user = value_behind(line);
    if (line.starts_with("///POSTYPE")) now_.kind = value_behind(line);
    if (line.starts_with("///RCONF")) {
      now_.conf.clear();
      for (const Piece& piece : pieces_of(text_, begin + 8, end, number, {})) {
        if (const auto written = read_number(piece.text))
          now_.conf.push_back(static_cast<int>(std::clamp(written->value, -1e6, 1e6)));
      }
    }
    const std::size_t equals = line.find('=');
    if (!names_position(line) || equals == std::string_view::npos) return;
    Position position = now_;
    position.begin = begin;
    position.line = number;
    for (const Piece& piece : pieces_of(text_, begin + equals + 1, end, number, {})) {
      if (piece.kind == Piece::Kind::kNumber) position.numbers.push_back(piece);
    }
    const auto [known, fresh] =
        positions_.emplace(std::string(line.substr(0, equals)), std::move(position));
    if (!fresh) known->second.again_at = number;
  }

  /// What stands behind the position in a motion; `BP001` is a variable.
  static bool is_external(const Piece& piece) {
    return piece.kind == Piece::Kind::kWord && piece.text.size() > 2 &&
           (piece.text[0] == 'B' || piece.text[0] == 'E') &&
           (piece.text[1] == 'C' || piece.text[1] == 'P' || piece.text[1] == 'X') &&
           piece.text[2] >= '0' && piece.text[2] <= '9';
  }

  /// Where the axes stand that carry the robot or the part, as the motions to a position say. They
  /// are in pulses: it can only be told whether they move.
  std::string take_external(const Site& site, ProgramTarget& target) const {
    std::optional<std::map<int, double>> all;
    for (const SiteUse& use : site.uses) {
      std::map<int, double> now;
      const auto names = external_of_.find(use.move);
      for (const std::string& name :
           names == external_of_.end() ? std::vector<std::string>{} : names->second) {
        const auto known = positions_.find(name);
        if (known == positions_.end())
          return fmt::format("{} is a variable, which any job may set", shown(name));
        const bool base = name[0] == 'B';
        for (std::size_t k = 0; k < known->second.numbers.size() && k < 6; ++k) {
          now[(base ? kFirstBaseAxis : kFirstStationAxis) + static_cast<int>(k)] =
              read_number(known->second.numbers[k].text).value_or(WrittenNumber{}).value;
        }
      }
      if (all && *all != now) return "motions come to it with external axes at different places";
      all = now;
    }
    if (all) target.external = std::move(*all);
    return "";
  }

  std::size_t tool_of(const Position& position) {
    ProgramTool tool;
    tool.name = fmt::format(
        "TOOL[{}]", position.tool.empty() ? "0" : position.tool.substr(0, position.tool.find(',')));
    const bool by_row = take_row(tool.name, options_, tool);
    if (const inform::Condition* condition = controller_.take(tool.name); condition != nullptr) {
      tool.why_not = by_row ? against(*condition, tool.row, *tool.X_FT) : condition->why_not;
      tool.load = condition->load;
      tool.file = condition->file;
      tool.line = condition->line;
      if (!by_row && tool.why_not.empty()) tool.X_FT = condition->X;
    }
    if (std::string set = why_set(tool.name, "TOOL[*]"); !set.empty())
      tool.why_not = std::move(set);
    for (std::size_t k = 0; k < program_.tools.size(); ++k) {
      if (program_.tools[k].name == tool.name) return k;
    }
    program_.tools.push_back(std::move(tool));
    return program_.tools.size() - 1;
  }

  std::size_t frame_of(const Position& position) {
    ProgramFrame frame;
    frame.name = position.kind;
    if (position.kind == "USER") {
      frame.name = fmt::format("USER[{}]", position.user);
      frame.why_not = why_set(frame.name, "USER[*]");
      if (frame.why_not.empty()) frame.why_not = why_set(frame_of_call(name_), "");
      if (!frame.why_not.empty()) return add_once(program_, std::move(frame));
      take_user_frame(frame);
    } else if (position.kind == "ROBOT") {
      frame.in_base = true;
    } else if (position.kind != "BASE" && position.kind != "PULSE") {
      frame.why_not = fmt::format("frame {} is not known", shown(position.kind));
    }
    return add_once(program_, std::move(frame));
  }

  /// Rows are seen from the robot's base, and so are the controller's user frames.
  void take_user_frame(ProgramFrame& frame) const {
    const bool by_row = take_row(frame.name, options_, frame);
    const inform::Condition* condition = controller_.take(frame.name);
    if (condition == nullptr) {
      if (!by_row)
        frame.why_not = fmt::format("{} is not in the files handed over: --frames tells its value",
                                    shown(frame.name));
      return;
    }
    frame.why_not = by_row ? against(*condition, frame.row, frame.X_BO) : condition->why_not;
    if (!by_row) frame.X_BO = condition->X;
    frame.in_base = true;
  }
  static std::string against(const inform::Condition& condition, const std::string& row,
                             const Pose& X) {
    if (!condition.why_not.empty()) return condition.why_not;
    return against_row(row, X, condition.X,
                       fmt::format("{} line {}", condition.file, condition.line));
  }

  /// Why a frame or tool is not what it was; empty: no job sets it.
  [[nodiscard]] std::string why_set(const std::string& name, const std::string& any) const {
    for (const std::string& one : {name, any}) {
      if (const auto set = set_->find(one); set != set_->end()) return set->second;
    }
    return "";
  }

  [[nodiscard]] std::vector<Piece> pieces_at(const Statement& statement) const {
    return pieces_of(text_, statement.begin, statement.end, statement.line, {"'", "\""});
  }
  /// Up to the next blank.
  [[nodiscard]] std::string word_from(std::size_t at) const {
    return text_.substr(at, std::min(text_.find_first_of(" \t\r\n", at), text_.size()) - at);
  }

 public:
  void motion(const Statement& statement, const Displaced& displaced) {
    const std::vector<Piece> pieces = pieces_at(statement);
    const int number = statement.line;
    if (pieces.empty()) return;
    const std::string word(pieces[0].text);
    static const std::set<std::string> kMotions = {"MOVJ", "MOVL", "MOVC", "MOVS", "IMOV"};
    if (pieces.size() < 2) return;
    if (!kMotions.contains(word)) return unknown(statement, pieces);
    const bool goes_on =
        !program_.moves.empty() && program_.moves.back().file == index_ && last_motion_ == word;
    program_.moves.push_back({index_, number, {}, word == "MOVC"});
    program_.moves.back().arc_goes_on = word == "MOVC" && goes_on;
    program_.moves.back().speed_mm_s = speed_of(pieces);
    last_motion_ = word;
    const std::string name(pieces[1].text);
    const auto leave = [&](const std::string& why) {
      used_.insert(name);
      program_.moves.back().left_some = true;
      program_.left.push_back({name, index_, number, word, why});
    };
    for (const Piece& piece : pieces) {
      if (piece.is("UNTIL") || piece.is("SRCH"))
        return leave(fmt::format("a sensor may end the motion ({})", piece.text));
    }
    if (group_.starts_with("RB") && group_.substr(0, group_.find(',')) != "RB1")
      return leave(fmt::format("the job moves {}, another robot",
                               shown(group_.substr(0, group_.find(',')))));
    if (word == "IMOV") return leave("it is relative to where the robot is");
    if (!displaced.shifted.empty())
      return leave(fmt::format("SFTON displaces it ({})", displaced.shifted));
    if (!displaced.sensed.empty())
      return leave(fmt::format("a sensor or a soft axis moves it: {}", displaced.sensed));
    const auto position = positions_.find(name);
    if (position == positions_.end()) return leave("it is a variable, which any job may set");
    if (name[0] != 'C') return leave("it moves external axes alone");
    for (std::size_t at = 2; at < pieces.size(); ++at) {
      if (is_external(pieces[at]))
        external_of_[program_.moves.size() - 1].emplace_back(pieces[at].text);
    }
    used_.insert(name);
    sites_.add(index_, position->second.begin, name,
               {tool_of(position->second), frame_of(position->second), word, index_, number,
                program_.moves.size() - 1, word != "MOVJ"});
  }

 private:
  /// `SMOVL C00000 ...`, `SYMOVL C00000 ...`: of a part that moves, or more.
  void unknown(const Statement& statement, const std::vector<Piece>& pieces) {
    static const std::set<std::string> kStill = {"REFP", "MFRAME", "SETTOOL",
                                                 "CALL", "JUMP",   "PSTART"};
    const std::string word = word_from(pieces[0].begin);
    if (kStill.contains(word)) return;
    for (const Piece& piece : pieces) {
      const std::string name(piece.text);
      if (piece.text[0] != 'C' || !positions_.contains(name)) continue;
      used_.insert(name);
      program_.moves.push_back({index_, statement.line, {}, false});
      program_.moves.back().left_some = true;
      program_.left.push_back(
          {name, index_, statement.line, word,
           fmt::format("{} is not known here: it may move the robot there", shown(word))});
    }
  }

  /// `V=138.0`, mm/s, of a motion of the tool. `VJ=50.00` is a share of what the axes can.
  static std::optional<double> speed_of(const std::vector<Piece>& pieces) {
    for (std::size_t at = 0; at + 2 < pieces.size(); ++at) {
      if (!pieces[at].is("V") || !pieces[at + 1].is("=")) continue;
      if (const auto speed = read_number(pieces[at + 2].text)) return speed->value;
    }
    return std::nullopt;
  }

  /// `1,0,0,0,0,0`: wrist not flipped, upper arm, front; R, T, S below 180 deg.
  static Configuration configuration_of(const std::vector<int>& conf) {
    Configuration said;
    if (conf.size() < 3) return said;
    said.bends_down = conf[0] == 1;
    said.elbow_up = conf[1] == 0;
    said.behind_axis_1 = conf[2] == 1;
    said.turns.resize(6);
    constexpr std::array<std::size_t, 3> kTurning = {3, 5, 0};
    for (std::size_t k = 0; k < 3 && k + 3 < conf.size(); ++k) {
      if (conf[k + 3] == 0) said.turns[kTurning[k]] = 0;
    }
    return said;
  }

  std::size_t index_;
  Program& program_;
  Sites& sites_;
  const ReadOptions& options_;
  Controller& controller_;
  const std::string& text_;
  int jobs_at_ = 0;  ///< the line of a job's head that has no end yet
  Position now_;
  std::map<std::string, Position> positions_;
  std::set<std::string> used_;
  std::string name_, last_motion_, group_;
  std::map<std::size_t, std::vector<std::string>> external_of_;  ///< names, by the motion
  std::vector<Statement> statements_;
  const std::map<std::string, std::string>* set_ = nullptr;
};

/// The motions of all jobs, each with the shift that holds before it: a job calls another.
void read_motions(std::vector<Job>& jobs) {
  struct Place {
    std::size_t job = 0;
    const Statement* statement = nullptr;  ///< nullptr: none stands there
  };
  std::vector<Step> steps;
  std::vector<Place> places;
  const auto add = [&](Step step, Place place) {
    steps.push_back(std::move(step));
    places.push_back(place);
  };
  std::map<std::string, std::string> set;
  for (Job& job : jobs) {
    job.note_settings(set);
    job.take_settings(set);
  }
  for (std::size_t j = 0; j < jobs.size(); ++j) {
    add({Step::Kind::kRoutine, jobs[j].name()}, {});
    for (const Statement& statement : jobs[j].statements()) {
      bool first = true;
      for (Step& step : jobs[j].steps_of(statement)) {
        add(std::move(step), first ? Place{j, &statement} : Place{});
        first = false;
      }
    }
    add({Step::Kind::kEnd}, {});
  }
  const std::vector<Displaced> shifted = states_before(
      flow_of(steps), Displaced{},
      [&](std::size_t s, Displaced& displaced) {
        if (places[s].statement != nullptr)
          jobs[places[s].job].shift(*places[s].statement, displaced);
      },
      [](Displaced& one, const Displaced& other, const std::string&) {
        if (one.shifted.empty()) one.shifted = other.shifted;
        if (one.sensed.empty()) one.sensed = other.sensed;
      });
  for (std::size_t s = 0; s < steps.size(); ++s) {
    if (places[s].statement != nullptr)
      jobs[places[s].job].motion(*places[s].statement, shifted[s]);
  }
  for (Job& job : jobs) job.list_unused();
}

}  // namespace

Program read_inform(std::vector<SourceFile> files, const ReadOptions& options) {
  Program program;
  program.dialect = "inform";
  program.files = std::move(files);
  Sites sites;
  Controller controller{inform::conditions(options.beside), {}};
  std::vector<Job> jobs;
  jobs.reserve(program.files.size());
  for (std::size_t f = 0; f < program.files.size(); ++f)
    jobs.emplace_back(f, program, sites, options, controller).read();
  read_motions(jobs);
  for (const auto& [file, names] : controller.taken)
    program.notes.push_back(fmt::format("{}: taken from {}", fmt::join(names, ", "), file));
  sites.finish(program, [&](const Site& site, ProgramTarget& target) {
    return jobs[site.file].describe(site, target);
  });
  return program;
}

}  // namespace trammel::cam
