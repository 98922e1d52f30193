#include "clients/cam/fanuc/fanuc.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <set>

#include "clients/cam/fanuc/controller.h"
#include "clients/cam/fanuc/positions.h"
#include "clients/cam/fanuc/statements.h"
#include "clients/cam/fanuc/system_frames.h"
#include "clients/cam/flow.h"
#include "clients/cam/scan.h"
#include "clients/cam/sites.h"
#include "server/base/plain_text.h"
#include "server/base/units.h"

namespace trammel::cam {

namespace {

using fanuc::called_by;
using fanuc::constant_at;
using fanuc::Controller;
using fanuc::done_perhaps;
using fanuc::Group;
using fanuc::indexed;
using fanuc::is_group;
using fanuc::is_number;
using fanuc::macro_in;
using fanuc::number;
using fanuc::Part;
using fanuc::part_of;
using fanuc::Pieces;
using fanuc::Position;
using fanuc::positions_of;
using fanuc::Setting;
using fanuc::statements_of;

constexpr std::array<const char*, 6> kPose = {"X", "Y", "Z", "W", "P", "R"};
constexpr std::array<const char*, 6> kJoints = {"J1", "J2", "J3", "J4", "J5", "J6"};

/// What UFRAME_NUM and UTOOL_NUM select: a number; empty: not set; else why it is not known.
struct Selected {
  std::string frame, tool;
  std::string beside;  ///< a program that may select another one at any time, as the statement that
                       ///< starts it; or empty
  std::string follows;  ///< what moves the targets at run time, `Track TAST[1]`; or empty
  bool operator==(const Selected&) const = default;
};

constexpr const char* kDecided =
    "a branch, a jump or a loop of the program, or a caller, decides it";

class File {
 public:
  File(std::size_t index, Program& program, Sites& sites, Controller& controller,
       const ReadOptions& options)
      : index_(index),
        program_(program),
        sites_(sites),
        controller_(controller),
        options_(options),
        text_(program.files[index].text) {}

  /// Its positions, and what it sets.
  void read() {
    name_ = fanuc::name_of_program(program_.files[index_]);
    controller_.programs.insert(name_);
    const Part motions = part_of(text_, "/MN");
    program_.mark_places.push_back({motions.begin, "   0:  !", " ;", true});
    for (Position& position : positions_of(text_, part_of(text_, "/POS"))) {
      by_name_[position.name] = position.begin;
      positions_[position.begin] = std::move(position);
    }
    statements_ = statements_of(text_, motions);
    note_line_tracking(part_of(text_, "/APPL"));
    for (const Pieces& statement : statements_) note_setting(statement);
  }

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] std::size_t statements() const { return statements_.size(); }

  /// What a statement does to the order, when all files are read. A call on a condition makes a
  /// block.
  [[nodiscard]] std::vector<Step> steps_of(std::size_t s) {
    const Pieces& statement = statements_[s];
    note_load(statement);
    if (const std::string called = called_by(statement); controller_.programs.contains(called)) {
      const Step call{Step::Kind::kCall, called};
      if (statement[0].is("CALL")) return {call};
      return {{Step::Kind::kIf}, call, {Step::Kind::kEnd}};
    }
    Step step = fanuc::step_of(statement);
    const bool jumps = step.kind == Step::Kind::kJump || step.kind == Step::Kind::kJumpMaybe;
    jumps_anywhere_ |= jumps && !is_number(step.label);
    if (jumps || step.kind == Step::Kind::kLabel)
      step.label = fmt::format("{}:{}", index_, step.label);
    return {step};
  }

  /// `UFRAME_NUM=1`, `UTOOL_NUM=R[2]`, `CALL SUB`
  void select(std::size_t s, Selected& selected) const { select(statements_[s], selected); }
  static void join(Selected& state, const Selected& other, const std::string&) {
    if (state.frame != other.frame) state.frame = kDecided;
    if (state.tool != other.tool) state.tool = kDecided;
    if (state.beside.empty()) state.beside = other.beside;
    if (state.follows.empty()) state.follows = other.follows;
  }

  void motion(std::size_t s, const Selected& selected) { motion(statements_[s], selected); }

  /// Behind all motions.
  void finish() {
    for (const auto& known : positions_) {
      const auto& [begin, position] = known;
      const std::string& name = position.name;
      const bool listed = std::any_of(
          program_.left.begin(), program_.left.end(),
          [&](const LeftAlone& left) { return left.file == index_ && left.name == name; });
      if (!used_.contains(begin) && !listed)
        program_.left.push_back(
            {position.name, index_, position.line, "", "no motion in these files goes to it"});
    }
  }

  std::string describe(const Site& site, ProgramTarget& target) const {
    const Position& position = positions_.at(site.begin);
    target.line = position.line;
    if (!position.changed.empty()) return position.changed;
    const auto robot = position.groups.find(1);
    if (robot == position.groups.end()) return "it has no group 1";
    const Group& group = robot->second;
    for (const auto& [number_of_group, other] : position.groups) {
      if (number_of_group > 1 && other.values.contains("X"))
        return fmt::format("its group {} is another robot", number_of_group);
      fanuc::note_external(number_of_group, other, target);
    }
    const bool joints = group.values.contains("J1");
    if (joints && options_.keep_joints) return "joint targets are kept (--keep-joints)";
    target.coordinates = joints ? Coordinates::kJoints : Coordinates::kAnglesXyz;
    for (std::size_t k = 0; k < 6; ++k) {
      const char* name = joints ? kJoints[k] : kPose[k];
      const auto value = group.values.find(name);
      const auto written =
          value == group.values.end() ? std::nullopt : read_number(value->second.text);
      if (!written) return fmt::format("it does not say {}", name);
      target.numbers.push_back(written->value);
      target.rewrites.push_back(
          {{value->second.begin, value->second.end}, {}, {{k, written->style}}});
    }
    if (!joints) target.configuration = fanuc::configuration_of(group.config);
    return "";
  }

 private:
  /// `LINE_TRACK_SCHEDULE_NUMBER : 1` in /APPL; 0 is none.
  void note_line_tracking(const Part& part) {
    const Pieces pieces = pieces_of(text_, part.begin, part.end, part.line, {"", "'\""});
    bool scheduled = true;
    for (std::size_t at = 0; at < pieces.size(); ++at) {
      if (pieces[at].is("LINE_TRACK")) line_tracking_ = pieces[at].line;
      if (pieces[at].is("LINE_TRACK_SCHEDULE_NUMBER") && at + 2 < pieces.size())
        scheduled = !pieces[at + 2].is("0");
    }
    if (!scheduled) line_tracking_ = 0;
  }

  void select(const Pieces& statement, Selected& selected) const {
    const bool monitors =
        statement.size() > 1 && statement[0].is("MONITOR") && !statement[1].is("END");
    const bool names =
        statement.size() > 2 && (statement[0].is("ERROR_PROG") || statement[0].is("RESUME_PROG"));
    if (monitors) selected.beside = fmt::format("MONITOR {}", shown(statement[1].text));
    if (names) selected.beside = fmt::format("{}={}", statement[0].text, shown(statement[2].text));
    const bool offset = statement.size() > 2 &&
                        (statement[0].is("Touch") || statement[0].is("MP")) &&
                        (statement[1].is("Offset") || statement[1].is("OFFSET"));
    static const std::set<std::string_view> kFollows = {"Track", "TRACK", "SOFTFLOAT"};
    if (offset || (statement.size() > 1 && kFollows.contains(statement[0].text))) {
      const Piece& last = statement[offset ? 2 : 1];
      const bool ends = last.is("End") || last.is("END");
      const std::string what = last.is("[") ? "" : " " + shown(statement[1].text);
      selected.follows =
          ends ? "" : fmt::format("{}{} (line {})", statement[0].text, what, statement[0].line);
    }
    if (statement[0].is("TORQ_LIMIT") && statement.size() > 1) {
      constexpr double kWhole = 100;  // percent
      const auto limit = read_number(statement[1].text);
      const bool ends = limit && limit->value >= kWhole;
      selected.follows = ends ? "" : fmt::format("TORQ_LIMIT (line {})", statement[0].line);
    }
    for (std::size_t at = 0; at + 1 < statement.size(); ++at) {
      const bool calls =
          statement[at].is("CALL") && !controller_.programs.contains(called_by(statement));
      if (!calls && !statement[at].is("RUN")) continue;
      selected.frame = selected.tool =
          fmt::format("{} {} may select another one", statement[at].text, statement[at + 1].text);
    }
    if (const std::string macro = macro_in(statement); !macro.empty())
      selected.frame = selected.tool =
          fmt::format("{} (line {}) is not known here: it may select another one", shown(macro),
                      statement[0].line);
    if (statement[0].is("LBL") && jumps_anywhere_) selected.frame = selected.tool = kDecided;
    select_number(statement, selected);
  }

  /// `UFRAME_NUM=1`, `UTOOL_NUM[GP1]=R[2]`, `IF (DI[1]),UFRAME_NUM=2`
  void select_number(const Pieces& statement, Selected& selected) const {
    const std::size_t at = done_perhaps(statement);
    const bool frame = statement[at].is("UFRAME_NUM") || statement[at].is("$MNUFRAMENUM");
    if (!frame && !statement[at].is("UTOOL_NUM") && !statement[at].is("$MNUTOOLNUM")) return;
    std::size_t equals = at + 1;
    bool others = false, ours = false;
    for (; equals < statement.size() && !statement[equals].is("="); ++equals) {
      ours |= statement[equals].is("GP1");
      others |= is_group(statement[equals]) && !statement[equals].is("GP1");
      others |= statement[equals].kind == Piece::Kind::kNumber && !statement[equals].is("1");
    }
    if (equals >= statement.size() || (others && !ours)) return;
    const std::optional<double> constant = constant_at(statement, equals + 1);
    const std::string now =
        constant ? fmt::format("{:g}", *constant)
                 : fmt::format("{} is set at run time ({} line {})", statement[at].text,
                               program_.files[index_].name, statement[at].line);
    std::string& number = frame ? selected.frame : selected.tool;
    number = at == 0 || number == now ? now : kDecided;
  }
  /// What is selected where a program beside may select another one.
  static std::string with(const std::string& selected, const std::string& beside) {
    return beside.empty() || !is_number(selected) ? selected : beside + " may select another one";
  }

  /// `PAYLOAD[3]`
  void note_load(const Pieces& statement) {
    for (std::size_t at = 0; at + 2 < statement.size(); ++at) {
      if (!statement[at].is("PAYLOAD")) continue;
      Controller::Statements& set = controller_.loads[indexed(statement, at)];
      if (set.count++ == 0)
        set.first = fmt::format("{} line {}", program_.files[index_].name, statement[at].line);
    }
  }

  /// `UTOOL[2]=PR[5]`, `PR[5,1]=100`, `PR[5]=LPOS`, `P[1]=...`, also behind `IF (...),`
  void note_setting(const Pieces& whole) {
    const std::size_t begin = done_perhaps(whole);
    const Pieces statement(whole.begin() + static_cast<std::ptrdiff_t>(begin), whole.end());
    if (statement.size() < 3) return;
    std::size_t equals = 0;
    while (equals < statement.size() && !statement[equals].is("=")) ++equals;
    if (equals + 1 >= statement.size()) return;
    const std::string word(statement[0].text);
    const std::string name = indexed(statement, 0);
    const std::string where =
        fmt::format("{} line {}", program_.files[index_].name, statement[0].line);
    note_reading(statement, equals, name);
    if (name.empty()) return;
    const std::string why = fmt::format("{} is set at run time ({})", name, where);
    if (word == "PR") {
      controller_.note_register(statement, equals, name, where, index_);
      if (begin > 0) controller_.registers[name].changed = why;
    } else if (word == "UFRAME" || word == "UTOOL") {
      const std::string from = indexed(statement, equals + 1);
      Setting& set =
          controller_.settings.try_emplace(name, Setting{from, where, index_}).first->second;
      if (set.from != from || begin > 0 || name.ends_with("[*]")) set.changed = why;
    } else if ((word == "$MNUFRAME" || word == "$MNUTOOL") && statement.size() > 4 &&
               statement[2].is("1")) {
      const bool one = statement[4].kind == Piece::Kind::kNumber;
      const std::string own = fmt::format("{}[{}]", word.substr(3), one ? statement[4].text : "*");
      controller_.settings[own].changed = fmt::format("{} is set at run time ({})", word, where);
    } else if (name.starts_with("P[")) {
      const auto position = by_name_.find(name);
      if (position != by_name_.end()) positions_[position->second].changed = why;
      if (name == "P[*]") {
        for (auto& [at, any] : positions_) any.changed = why;
      }
    }
  }

  /// `PR[5]=P[3]`, `P[4]=P[3]`
  void note_reading(const Pieces& statement, std::size_t equals, const std::string& name) {
    for (std::size_t at = equals + 1; at + 2 < statement.size(); ++at) {
      if (!statement[at].is("P")) continue;
      const std::string from = indexed(statement, at);
      for (const auto& [known, begin] : by_name_) {
        if (known == from || from == "P[*]")
          program_.readings.push_back(
              {index_, {begin, positions_.at(begin).end}, known, index_, statement[0].line, name});
      }
    }
  }

  std::size_t add_frame(ProgramFrame frame) { return add_once(program_, std::move(frame)); }
  std::size_t add_tool(ProgramTool tool) { return add_once(program_, std::move(tool)); }

  /// `UF : F` is the frame that is selected. Where another one is selected than the point has, the
  /// controller stops.
  std::size_t frame_of(const std::string& number_text, const std::string& selected) {
    const std::string why = why_not_there("UF", "UFRAME_NUM", number_text, selected);
    if (why.empty())
      return add_frame(controller_.frame_of(number_text == "F" ? selected : number_text, options_));
    return add_frame({fmt::format("UFRAME[{}]", number_text), Pose::Identity(), why});
  }
  std::size_t tool_of(const std::string& number_text, const std::string& selected) {
    const std::string why = why_not_there("UT", "UTOOL_NUM", number_text, selected);
    if (why.empty())
      return add_tool(controller_.tool_of(number_text == "F" ? selected : number_text, options_,
                                          program_.files[index_].name));
    ProgramTool tool;
    tool.name = fmt::format("UTOOL[{}]", number_text);
    tool.why_not = why;
    return add_tool(std::move(tool));
  }
  /// Of a point with its own number, beside what is selected where a motion goes to it; empty: they
  /// agree.
  static std::string why_not_there(const char* own, const char* word,
                                   const std::string& number_text, const std::string& selected) {
    if (number_text.empty()) return fmt::format("the point does not say its {}", own);
    if (number_text != "F") {
      if (!is_number(number_text) || !is_number(selected) || number_text == selected) return "";
      return fmt::format("the point has {} : {}, and {} is {} there: the controller stops", own,
                         number_text, word, selected);
    }
    if (is_number(selected)) return "";
    return selected.empty() ? fmt::format("{} : F, and no {} is set before it", own, word)
                            : fmt::format("{} : F, {}", own, selected);
  }

  void leave(const Pieces& statement, const std::string& name, const std::string& why) {
    program_.moves.back().left_some = true;
    program_.left.push_back({name, index_, statement[0].line, std::string(statement[0].text), why});
  }

  /// `J P[1] 100% FINE`, `L PR[3] ... Offset,PR[1]`, `C P[4] P[5] ...`, `A P[6] ...`
  void motion(const Pieces& statement, const Selected& selected) {
    static const std::set<std::string_view> kMotions = {"J", "L", "C", "A", "S"};
    if (statement.size() < 4 || !kMotions.contains(statement[0].text)) return;
    // `L PAL_1[BTM] 100mm/sec FINE`
    const bool elsewhere = !statement[1].is("P") && !statement[1].is("PR");
    if (elsewhere && (statement[1].kind != Piece::Kind::kWord || !statement[2].is("["))) return;
    const bool goes_on = statement[0].is("A") && last_motion_ == "A";
    program_.moves.push_back(
        {index_, statement[0].line, {}, statement[0].is("C") || statement[0].is("A")});
    program_.moves.back().arc_goes_on = goes_on;
    last_motion_ = std::string(statement[0].text);
    note_speed(statement);
    if (elsewhere)
      return leave(statement, std::string(statement[1].text), "it is no point of /POS");
    std::string why;
    if (line_tracking_ != 0)
      why = fmt::format(
          "LINE_TRACK (line {}): it is seen from a conveyor that moves, not from the user frame",
          line_tracking_);
    if (!selected.follows.empty()) why = selected.follows + " moves it at run time";
    for (const Piece& piece : statement) {
      if (piece.is("Track") || piece.is("TRACK"))
        why = fmt::format("{} moves it at run time", piece.text);
      if (piece.is("Offset") || piece.is("OFFSET") || piece.is("Tool_Offset") ||
          piece.is("TOOL_OFFSET") || piece.is("VOFFSET") || piece.is("INC"))
        why = fmt::format("{} displaces it at run time", piece.text);
      if (piece.is("RTCP")) why = "the tool stands and the robot holds the work piece (RTCP)";
      if (piece.is("Skip") || piece.is("SKIP") || piece.is("Search"))
        why = fmt::format("a sensor may end the motion ({})", piece.text);
    }
    for (std::size_t at = 1; at + 2 < statement.size(); ++at) {
      if ((!statement[at].is("P") && !statement[at].is("PR")) || !statement[at + 1].is("["))
        continue;
      if (at > 1 && statement[at - 1].is(",")) continue;  // the register of an offset
      const std::string name = indexed(statement, at);
      if (statement[at].is("PR")) {
        leave(statement, name, "it is a register, which any program may set");
      } else if (!why.empty()) {
        leave(statement, name, why);
      } else {
        use(statement, name, selected);
      }
      if (!statement[0].is("C")) return;
    }
  }

  /// `250mm/sec`, `1500.0cm/min`
  void note_speed(const Pieces& statement) {
    for (std::size_t at = 0; at + 3 < statement.size(); ++at) {
      if (statement[at].kind != Piece::Kind::kNumber || !statement[at + 2].is("/")) continue;
      const Piece &length = statement[at + 1], &time = statement[at + 3];
      const double mm = length.is("mm") ? 1 : length.is("cm") ? 10 : length.is("inch") ? 25.4 : 0;
      const double s = time.is("sec") ? 1 : time.is("min") ? 60 : 0;
      if (mm > 0 && s > 0) program_.moves.back().speed_mm_s = number(statement[at]) * mm / s;
    }
  }

  void use(const Pieces& statement, const std::string& name, const Selected& selected) {
    bool any = false;
    for (const auto& [known, begin] : by_name_) {
      if (known != name && name != "P[*]") continue;
      any = true;
      const Position& position = positions_.at(begin);
      const auto group = position.groups.find(1);
      const Group empty;
      const Group& robot = group == position.groups.end() ? empty : group->second;
      const bool joint = statement[0].is("J");
      sites_.add(index_, begin, known,
                 {tool_of(robot.tool, with(selected.tool, selected.beside)),
                  frame_of(robot.frame, with(selected.frame, selected.beside)),
                  std::string(statement[0].text), index_, statement[0].line,
                  program_.moves.size() - 1, !joint});
      used_.insert(begin);
    }
    if (!any) leave(statement, name, fmt::format("{} is not in /POS", name));
  }

  std::size_t index_;
  Program& program_;
  Sites& sites_;
  Controller& controller_;
  const ReadOptions& options_;
  const std::string& text_;
  std::map<std::size_t, Position> positions_;  ///< by their first byte
  std::map<std::string, std::size_t> by_name_;
  std::vector<Pieces> statements_;
  std::string name_, last_motion_;
  bool jumps_anywhere_ = false;  ///< `JMP LBL[R[1]]`
  int line_tracking_ = 0;        ///< the line that says so; 0: none does
  std::set<std::size_t> used_;
};

/// The motions of all programs, each with what is selected before it: a program calls another.
void read_motions(std::vector<File>& files) {
  struct Place {
    std::size_t file = 0, statement = 0;
    bool is_one = false;  ///< a statement stands there
  };
  std::vector<Step> steps;
  std::vector<Place> places;
  const auto add = [&](Step step, Place place) {
    steps.push_back(std::move(step));
    places.push_back(place);
  };
  for (std::size_t f = 0; f < files.size(); ++f) {
    add({Step::Kind::kRoutine, files[f].name()}, {});
    int open = 0;  // an ENDIF without its IF ends no program
    for (std::size_t s = 0; s < files[f].statements(); ++s) {
      bool first = true;
      for (Step& step : files[f].steps_of(s)) {
        if (step.kind == Step::Kind::kIf || step.kind == Step::Kind::kWhile) ++open;
        if (step.kind == Step::Kind::kEnd && open-- == 0) {
          open = 0;
          step.kind = Step::Kind::kPlain;
        }
        add(std::move(step), first ? Place{f, s, true} : Place{});
        first = false;
      }
    }
    for (; open >= 0; --open) add({Step::Kind::kEnd}, {});
  }
  const std::vector<Selected> selected = states_before(
      flow_of(steps), Selected{},
      [&](std::size_t step, Selected& state) {
        if (places[step].is_one) files[places[step].file].select(places[step].statement, state);
      },
      File::join);
  for (std::size_t step = 0; step < steps.size(); ++step) {
    if (places[step].is_one)
      files[places[step].file].motion(places[step].statement, selected[step]);
  }
  for (File& file : files) file.finish();
}

/// What was taken from the system variables, a sentence a file.
std::vector<std::string> notes_on_system(const Controller& controller) {
  std::map<std::string, std::vector<std::string>> by_file;
  for (const auto& [name, file] : controller.taken) by_file[file].push_back(name);
  std::vector<std::string> notes;
  for (const auto& [file, names] : by_file)
    notes.push_back(fmt::format("{}: taken from {}", fmt::join(names, ", "), file));
  return notes;
}

}  // namespace

Program read_fanuc(std::vector<SourceFile> files, const ReadOptions& options) {
  Program program;
  program.dialect = "fanuc";
  program.files = std::move(files);
  Sites sites;
  Controller controller;
  controller.system = fanuc::system_frames(options.beside);
  std::vector<File> read;
  read.reserve(program.files.size());
  for (std::size_t f = 0; f < program.files.size(); ++f)
    read.emplace_back(f, program, sites, controller, options).read();
  read_motions(read);
  for (std::string& note : notes_on_system(controller)) program.notes.push_back(std::move(note));
  for (const auto& [load, set] : controller.loads)
    program.notes.push_back(fmt::format(
        "{} ({}{}): the controller alone knows this load, it is not compared with the cell's", load,
        set.first, set.count > 1 ? fmt::format(" and {} more", set.count - 1) : ""));
  sites.finish(program, [&](const Site& site, ProgramTarget& target) {
    return read[site.file].describe(site, target);
  });
  return program;
}

}  // namespace trammel::cam
