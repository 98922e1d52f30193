#include "clients/cam/fanuc/fanuc.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <set>

#include "clients/cam/fanuc/controller.h"
#include "clients/cam/fanuc/positions.h"
#include "clients/cam/fanuc/statements.h"
#include "clients/cam/flow.h"
#include "clients/cam/keep.h"
#include "clients/cam/sites.h"
#include "server/base/plain_text.h"

namespace trammel::cam {

namespace {

using fanuc::Assignment;
using fanuc::Controller;
using fanuc::Group;
using fanuc::is_number;
using fanuc::kJoints;
using fanuc::kPose;
using fanuc::Motion;
using fanuc::Part;
using fanuc::part_of;
using fanuc::Position;
using fanuc::Setting;
using fanuc::Statement;

/// The selection of UFRAME_NUM and UTOOL_NUM: a number; empty: not set; else why it is not known.
struct Selected {
  std::string frame, tool;
  std::string beside;   ///< the statement that starts a concurrent program which may select another
                        ///< one at any time; or empty
  std::string follows;  ///< the instruction that moves the targets at run time, `Track TAST[1]`; or
                        ///< empty
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

  /// Reads its positions and its settings.
  void read() {
    name_ = fanuc::name_of_program(program_.files[index_]);
    controller_.programs.insert(name_);
    const Part motions = part_of(text_, "/MN");
    program_.mark_places.push_back({motions.begin, "   0:  !", " ;", true});
    const Part points = part_of(text_, "/POS");
    points_end_ = points.end;
    PointList& list = program_.points.emplace_back();
    for (Position& position : fanuc::positions_of(text_, points)) {
      list.next = std::max(list.next, 1 + fanuc::point_number(position.name));
      by_name_[position.name] = position.begin;
      positions_[position.begin] = std::move(position);
    }
    statements_ = fanuc::statements_of(text_, motions);
    note_line_tracking(part_of(text_, "/APPL"));
    for (const Statement& statement : statements_) {
      if (statement.assignment && !statement.assignment->value.empty())
        note_setting(*statement.assignment);
    }
  }

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] std::size_t statements() const { return statements_.size(); }

  /// The effect of a statement on the order, when all files are read. A call on a condition makes a
  /// block.
  [[nodiscard]] std::vector<Step> steps_of(std::size_t s) {
    const Statement& statement = statements_[s];
    note_loads(statement);
    if (controller_.programs.contains(statement.called)) {
      const Step call{Step::Kind::kCall, statement.called};
      if (statement.begins("CALL")) return {call};
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
  void select(std::size_t s, Selected& selected) const {
    const Statement& statement = statements_[s];
    if (std::string beside = fanuc::started_beside(statement); !beside.empty())
      selected.beside = std::move(beside);
    if (auto follows = fanuc::follows_behind(statement)) selected.follows = std::move(*follows);
    for (const fanuc::Start& start : statement.starts) {
      if (start.by == "CALL" && controller_.programs.contains(statement.called)) continue;
      selected.frame = selected.tool =
          fmt::format("{} {} may select another one", start.by, start.program);
    }
    if (!statement.macro.empty())
      selected.frame = selected.tool =
          fmt::format("{} (line {}) is not known here: it may select another one",
                      shown(statement.macro), statement.line);
    if (statement.begins("LBL") && jumps_anywhere_) selected.frame = selected.tool = kDecided;
    if (statement.assignment) select_number(*statement.assignment, selected);
  }
  static void join(Selected& state, const Selected& other, const std::string&) {
    if (state.frame != other.frame) state.frame = kDecided;
    if (state.tool != other.tool) state.tool = kDecided;
    if (state.beside.empty()) state.beside = other.beside;
    if (state.follows.empty()) state.follows = other.follows;
  }

  void motion(std::size_t s, const Selected& selected) {
    const auto motion = fanuc::motion_of(statements_[s]);
    if (!motion) return;
    go(*motion, statements_[s].line, selected);
    repeat(*motion, statements_[s].tokens);
  }

  /// Behind all motions.
  void finish() {
    for (const auto& [begin, position] : positions_) {
      const bool listed = std::any_of(program_.left.begin(), program_.left.end(),
                                      [&, &name = position.name](const LeftAlone& left) {
                                        return left.file == index_ && left.name == name;
                                      });
      if (!used_.contains(begin) && !listed)
        leave_unused(program_, position.name, index_, position.line);
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
      if (value == group.values.end() || !keep(value->second, target))
        return fmt::format("it does not say {}", name);
    }
    if (!joints) target.configuration = fanuc::configuration_of(group.config);
    return "";
  }

 private:
  /// `LINE_TRACK_SCHEDULE_NUMBER : 1` in /APPL; 0 is none.
  void note_line_tracking(const Part& part) {
    const Tokens tokens = tokens_of(text_, part.begin, part.end, part.line, fanuc::kLexis);
    bool scheduled = true;
    for (std::size_t at = 0; at < tokens.size(); ++at) {
      if (tokens[at].is("LINE_TRACK")) line_tracking_ = tokens[at].line;
      if (tokens[at].is("LINE_TRACK_SCHEDULE_NUMBER") && at + 2 < tokens.size())
        scheduled = !tokens[at + 2].is("0");
    }
    if (!scheduled) line_tracking_ = 0;
  }

  /// `UFRAME_NUM=1`, `UTOOL_NUM[GP1]=R[2]`
  void select_number(const Assignment& set, Selected& selected) const {
    const std::string_view word = set.word();
    const bool frame = word == "UFRAME_NUM" || word == "$MNUFRAMENUM";
    if (!frame && word != "UTOOL_NUM" && word != "$MNUTOOLNUM") return;
    bool others = false;
    for (const Token token : set.target) {
      others |= fanuc::is_group(token) && !token.is("GP1");
      others |= token.is_number() && !token.is("1");
    }
    if (others && !set.target.has("GP1")) return;
    const std::string now = set.constant
                                ? fmt::format("{:g}", *set.constant)
                                : fmt::format("{} is set at run time ({})", word, where(set));
    std::string& number = frame ? selected.frame : selected.tool;
    number = !set.perhaps || number == now ? now : kDecided;
  }
  /// The selection, if a concurrent program may select another one.
  static std::string with(const std::string& selected, const std::string& beside) {
    return beside.empty() || !is_number(selected) ? selected : beside + " may select another one";
  }

  [[nodiscard]] std::string where(const Assignment& set) const {
    return fmt::format("{} line {}", program_.files[index_].name, set.target[0].line);
  }

  void note_loads(const Statement& statement) {
    for (const std::string& load : fanuc::loads_in(statement)) {
      Controller::Statements& set = controller_.loads[load];
      if (set.count++ == 0)
        set.first = fmt::format("{} line {}", program_.files[index_].name, statement.line);
    }
  }

  /// `UTOOL[2]=PR[5]`, `PR[5,1]=100`, `PR[5]=LPOS`, `P[1]=...`
  void note_setting(const Assignment& set) {
    note_reading(set);
    const std::string& name = set.name;
    if (name.empty()) return;
    const std::string_view word = set.word();
    const std::string why = fmt::format("{} is set at run time ({})", name, where(set));
    if (word == "PR") {
      controller_.note_register(set, where(set), index_);
      if (set.perhaps) controller_.registers[name].changed = why;
    } else if (word == "UFRAME" || word == "UTOOL") {
      const std::string from = fanuc::indexed(set.value, 0);
      Setting& known =
          controller_.settings.try_emplace(name, Setting{from, where(set), index_}).first->second;
      if (known.from != from || set.perhaps || name.ends_with("[*]")) known.changed = why;
    } else if ((word == "$MNUFRAME" || word == "$MNUTOOL") && set.target[2].is("1")) {
      const Token number = set.target[4];
      const std::string own =
          fmt::format("{}[{}]", word.substr(3), number.is_number() ? number.text : "*");
      controller_.settings[own].changed =
          fmt::format("{} is set at run time ({})", word, where(set));
    } else if (name == "P[*]") {
      for (auto& [at, any] : positions_) any.changed = why;
    } else if (name.starts_with("P[")) {
      if (const auto position = by_name_.find(name); position != by_name_.end())
        positions_[position->second].changed = why;
    }
  }

  /// `PR[5]=P[3]`, `P[4]=P[3]`
  void note_reading(const Assignment& set) {
    for (std::size_t at = 0; at + 2 < set.value.size(); ++at) {
      if (!set.value[at].is("P")) continue;
      const std::string from = fanuc::indexed(set.value, at);
      for (const auto& [known, begin] : by_name_) {
        if (known == from || from == "P[*]")
          program_.readings.push_back({index_,
                                       {begin, positions_.at(begin).end},
                                       known,
                                       index_,
                                       set.target[0].line,
                                       set.name});
      }
    }
  }

  /// `UF : F` is the selected frame. If a point has another number than the selected one, the
  /// controller stops.
  std::size_t frame_of(const std::string& number_text, const std::string& selected) {
    const std::string why = why_not_there("UF", "UFRAME_NUM", number_text, selected);
    if (why.empty())
      return add_once(program_,
                      controller_.frame_of(number_text == "F" ? selected : number_text, options_));
    return add_once(program_,
                    ProgramFrame{fmt::format("UFRAME[{}]", number_text), Pose::Identity(), why});
  }
  std::size_t tool_of(const std::string& number_text, const std::string& selected) {
    const std::string why = why_not_there("UT", "UTOOL_NUM", number_text, selected);
    if (why.empty())
      return add_once(program_, controller_.tool_of(number_text == "F" ? selected : number_text,
                                                    options_, program_.files[index_].name));
    ProgramTool tool;
    tool.name = fmt::format("UTOOL[{}]", number_text);
    tool.why_not = why;
    return add_once(program_, std::move(tool));
  }
  /// The conflict between a point's own number and the selected one when a motion goes to the
  /// point; empty: they agree.
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

  void leave_point(const Motion& motion, int line, const std::string& name,
                   const std::string& why) {
    leave(program_, {name, index_, line, std::string(motion.kind), why}, program_.moves.size() - 1);
  }

  void go(const Motion& motion, int line, const Selected& selected) {
    ProgramMove& move = program_.moves.emplace_back(ProgramMove{index_, line, {}, motion.is_arc()});
    move.arc_goes_on = motion.kind == "A" && last_motion_ == "A";
    move.speed_mm_s = motion.speed_mm_s;
    last_motion_ = motion.kind;
    if (!motion.elsewhere.empty())
      return leave_point(motion, line, std::string(motion.elsewhere), "it is no point of /POS");
    std::string why = motion.moved;
    if (why.empty() && !selected.follows.empty()) why = selected.follows + " moves it at run time";
    if (why.empty() && line_tracking_ != 0)
      why = fmt::format(
          "LINE_TRACK (line {}): it is seen from a conveyor that moves, not from the user frame",
          line_tracking_);
    for (const std::string& name : motion.points) {
      if (name.starts_with("PR"))
        leave_point(motion, line, name, "it is a register, which any program may set");
      else if (!why.empty())
        leave_point(motion, line, name, why);
      else
        use(motion, line, name, selected);
    }
  }

  /// `L P[2] 250mm/sec FINE`: the motion stops there. The repeated point gets a new number.
  void repeat(const Motion& motion, const Tokens& tokens) {
    if (motion.points.size() != 1 || (motion.kind != "J" && motion.kind != "L")) return;
    const auto known = by_name_.find(motion.points[0]);
    const std::size_t point = tokens.find("P"), behind = tokens.find("]", point);
    const std::size_t fine = tokens.find("FINE", point);
    if (known == by_name_.end() || behind >= tokens.size() || fine >= tokens.size()) return;
    for (std::size_t k = fine + 1; k < tokens.size(); ++k) {
      // `SPOT[1]` or `TB .1sec, CALL ...` do work at the place. The listed options do not.
      const std::string_view word = tokens[k].text;
      if (!word.starts_with("ACC") && word != "PTH" && word != "Wjnt" && !tokens[k].is_number())
        return;
    }
    if (!tokens[0].is(motion.kind)) return;  // `IF R[1]=1,J P[1] ...`
    const Position& position = positions_.at(known->second);
    const std::size_t end = text_.find_first_of(";\r\n", tokens[behind].end);
    const bool whole = end != std::string::npos && text_[end] == ';' &&
                       points_end_ < text_.size() && position.groups.contains(1);
    if (!whole) return;
    const auto text = [&](std::size_t from, std::size_t to) {
      return text_.substr(from, to - from);
    };
    std::vector<NewLine> lines = fanuc::another_position(text_, position, points_end_);
    if (lines.empty()) return;
    lines.push_back({tokens[0].begin,
                     {fmt::format("   0:{}P[{}]{};", text(tokens[0].begin, tokens[point].begin),
                                  kNewPoint, text(tokens[behind].end, end))},
                     {}});
    program_.moves.back().another = std::move(lines);
  }

  void use(const Motion& motion, int line, const std::string& name, const Selected& selected) {
    bool any = false;
    for (const auto& [known, begin] : by_name_) {
      if (known != name && name != "P[*]") continue;
      any = true;
      const Position& position = positions_.at(begin);
      const auto group = position.groups.find(1);
      const Group robot = group == position.groups.end() ? Group{} : group->second;
      sites_.add(
          index_, begin, known,
          {tool_of(robot.tool, with(selected.tool, selected.beside)),
           frame_of(robot.frame, with(selected.frame, selected.beside)), std::string(motion.kind),
           index_, line, program_.moves.size() - 1, motion.kind != "J"});
      used_.insert(begin);
    }
    if (!any) leave_point(motion, line, name, fmt::format("{} is not in /POS", name));
  }

  std::size_t index_;
  Program& program_;
  Sites& sites_;
  Controller& controller_;
  const ReadOptions& options_;
  const std::string& text_;
  std::map<std::size_t, Position> positions_;  ///< by their first byte
  std::map<std::string, std::size_t> by_name_;
  std::vector<Statement> statements_;
  std::string name_, last_motion_;
  bool jumps_anywhere_ = false;  ///< `JMP LBL[R[1]]`
  std::size_t points_end_ = 0;   ///< behind /POS
  int line_tracking_ = 0;        ///< the line that says so; 0: none does
  std::set<std::size_t> used_;
};

/// Reads the motions of all programs, each with the selection before it, since a program calls
/// others.
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
    int open = 0;  // an ENDIF without its IF does not end a program
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
  program.notes = controller.system.notes();
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
