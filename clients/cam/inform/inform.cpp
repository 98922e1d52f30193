#include "clients/cam/inform/inform.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <string_view>

#include "clients/cam/flow.h"
#include "clients/cam/inform/job.h"
#include "clients/cam/keep.h"
#include "clients/cam/sites.h"
#include "server/base/plain_text.h"

namespace trammel::cam {

namespace {

using inform::Motion;
using inform::Position;
using inform::Statement;

/// The instructions that move the robot away from its programmed motions.
struct Displaced {
  std::string shifted;  ///< the place of an active SFTON; empty: none is active
  std::string sensed;   ///< an active sensor or soft axis, as `COMARCON (drill.jbi line 7)`; empty:
                        ///< none
  bool operator==(const Displaced&) const = default;
};

class Job {
 public:
  Job(std::size_t index, Program& program, Sites& sites, const ReadOptions& options,
      ListedValues& listed)
      : index_(index),
        program_(program),
        sites_(sites),
        options_(options),
        listed_(listed),
        text_(inform::job_of(program.files[index].text)) {
    program_.mark_places.push_back({text_.mark_at, "'", "", true});
    list_points();
    if (text_.open_at > 0) program_.cuts.push_back({index_, text_.open_at, "the job has no END"});
  }

  [[nodiscard]] const std::string& name() const { return text_.name; }
  [[nodiscard]] const std::vector<Statement>& statements() const { return text_.statements; }

  /// Records the frames and tools that jobs set, with their places. A relative job uses another
  /// user frame than the one in its head if its call gives one.
  void note_settings(std::map<std::string, std::string>& set) const {
    for (const Statement& statement : text_.statements) {
      const std::string where =
          fmt::format("{} line {}", program_.files[index_].name, statement.line);
      if (statement.gives_frame())
        set.emplace(frame_of_call(std::string(statement.job)),
                    fmt::format("{} {} gives the job another user frame ({})", statement.word(),
                                shown(statement.job), where));
      if (const std::string what = statement.sets(); !what.empty())
        set.emplace(what, fmt::format("{} is set at run time ({})", what, where));
    }
  }
  static std::string frame_of_call(const std::string& job) { return "JOB:" + job; }

  /// Takes the settings of all jobs.
  void take_settings(const std::map<std::string, std::string>& set) { set_ = &set; }
  /// `SFTON`, `SFTOF`; `COMARCON`, `COMARCOF` of the seam's sensor, and their like.
  void shift(const Statement& statement, Displaced& displaced) const {
    static const std::map<std::string_view, bool> kSensors = {
        {"COMARCON", true}, {"COMARCOF", false}, {"FLOATON", true},
        {"FLOATOF", false}, {"PMTON", true},     {"PMTOF", false}};
    const std::string place =
        fmt::format("{} line {}", program_.files[index_].name, statement.line);
    if (statement.begins("SFTON")) displaced.shifted = place;
    if (statement.begins("SFTOF")) displaced.shifted.clear();
    if (const auto sensor = kSensors.find(statement.word()); sensor != kSensors.end())
      displaced.sensed = sensor->second ? fmt::format("{} ({})", sensor->first, place) : "";
  }

  void list_unused() {
    for (const auto& [name, position] : text_.positions) {
      if (!used_.contains(name) && name[0] == 'C')
        leave_unused(program_, name, index_, position.line, "this job");
    }
  }

  std::string describe(const Site& site, ProgramTarget& target) const {
    const Position& position = text_.positions.at(site.name);
    target.line = position.line;
    if (position.again_at != 0)
      return fmt::format("it stands there twice (line {}, line {})", position.line,
                         position.again_at);
    const bool in_pulses = position.kind == "PULSE";
    if (in_pulses && options_.keep_joints) return "joint targets are kept (--keep-joints)";
    if (in_pulses && options_.pulses_per_deg.empty())
      return "it is in pulses, and no file tells how many make a degree: give --pulses-per-deg "
             "S,L,U,R,B,T, or pulses_per_deg of each joint in the robot file (jog each axis, and "
             "divide what its pulses change by on the pendant by what its angle changes by)";
    if (position.numbers.size() < 6)
      return fmt::format("it has {} numbers, 6 are due", position.numbers.size());
    target.coordinates = in_pulses ? Coordinates::kJointPulses : Coordinates::kAnglesXyz;
    if (in_pulses) target.pulses_per_deg = options_.pulses_per_deg;
    if (std::string why = keep(position.numbers, 6, target); !why.empty()) return why;
    if (!in_pulses) target.configuration = inform::configuration_of(position.conf);
    return take_external(site, target);
  }

 private:
  /// Compares the axes that carry the robot or the part between the motions to a position. They are
  /// in pulses, so it only finds whether they move.
  std::string take_external(const Site& site, ProgramTarget& target) const {
    std::optional<std::map<int, double>> all;
    for (const SiteUse& use : site.uses) {
      std::map<int, double> now;
      const auto names = external_of_.find(use.move);
      for (const std::string& name :
           names == external_of_.end() ? std::vector<std::string>{} : names->second) {
        const auto known = text_.positions.find(name);
        if (known == text_.positions.end())
          return fmt::format("{} is a variable, which any job may set", shown(name));
        const bool base = name[0] == 'B';
        for (std::size_t k = 0; k < known->second.numbers.size() && k < 6; ++k) {
          now[(base ? kFirstBaseAxis : kFirstStationAxis) + static_cast<int>(k)] =
              value_in(known->second.numbers[k]);
        }
      }
      if (all && *all != now) return "motions come to it with external axes at different places";
      all = now;
    }
    if (all) target.external = std::move(*all);
    return "";
  }

  /// `///NPOS 2,0,0,0,0,0`
  void list_points() {
    PointList& list = program_.points.emplace_back();
    for (const auto& [name, position] : text_.positions) {
      if (name[0] != 'C' || name.size() > 9) continue;
      list.width = static_cast<int>(name.size()) - 1;
      list.next = std::max(list.next, 1 + std::stoul(name.substr(1)));
      if (last_ == nullptr || position.begin > last_->begin) last_ = &position;
    }
    const std::string& text = program_.files[index_].text;
    constexpr std::string_view kHead = "///NPOS ";
    const std::size_t head = text.find(kHead);
    if (head == std::string::npos) return;
    const std::size_t begin = head + kHead.size();
    const std::size_t end = std::min(text.find_first_not_of("0123456789", begin), text.size());
    if (end == begin || end - begin > 6) return;
    list.count = {begin, end};
    list.counted = std::stoul(text.substr(begin, end - begin));
  }

  /// `MOVL C00001 V=100.0`, with a position behind the last one, and with the same tool, frame and
  /// configuration.
  void repeat(const Statement& statement, const Motion& motion, const Position& position) {
    const std::string& text = program_.files[index_].text;
    const bool plain = (motion.word == "MOVJ" || motion.word == "MOVL") && motion.external.empty();
    const bool stops = !statement.tokens.has("PL") || text_of_pl(statement) == "0";
    static const std::set<std::string_view> kOfTheWay = {"V", "VJ", "PL", "ACC", "DEC", "="};
    for (std::size_t k = 2; k < statement.tokens.size(); ++k) {
      // `NWAIT` or `UNTIL IN#(1)=ON` do more than move the robot.
      if (!statement.tokens[k].is_number() && !kOfTheWay.contains(statement.tokens[k].text)) return;
    }
    if (!plain || !stops || last_ == nullptr || position.numbers.size() < 6 ||
        program_.points[index_].count.end == 0)
      return;
    if (position.kind != last_->kind || position.tool != last_->tool ||
        position.user != last_->user || position.conf != last_->conf)
      return;
    const Token name = statement.tokens[1];
    const std::size_t end = std::min(text.find_first_of("\r\n", name.end), text.size());
    const std::size_t behind = text.find('\n', last_->begin);
    if (behind == std::string::npos) return;
    NewText point({}, fmt::format("C{}=", kNewPoint));
    for (std::size_t k = 0; k < 6; ++k) {
      if (k > 0) point.text(",");
      const auto written = number_in(position.numbers[k]);
      if (!written) return;
      point.number(k, written->style.decimals);
    }
    program_.moves.back().another = {
        std::move(point).line(behind + 1),
        {name.begin,
         {fmt::format("{} C{}{}", motion.word, kNewPoint, text.substr(name.end, end - name.end))},
         {}}};
  }
  static std::string text_of_pl(const Statement& statement) {
    const std::size_t at = statement.tokens.find("PL");
    return std::string(statement.tokens[at + 2].text);
  }

  std::size_t tool_of(const Position& position) {
    ProgramTool tool;
    tool.name = fmt::format(
        "TOOL[{}]", position.tool.empty() ? "0" : position.tool.substr(0, position.tool.find(',')));
    const bool by_row = take_row(tool.name, options_, tool);
    if (const ListedValue* condition = listed_.take(tool.name); condition != nullptr) {
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
      if (frame.why_not.empty()) frame.why_not = why_set(frame_of_call(text_.name), "");
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
    const ListedValue* condition = listed_.take(frame.name);
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
  static std::string against(const ListedValue& condition, const std::string& row, const Pose& X) {
    if (!condition.why_not.empty()) return condition.why_not;
    return against_row(row, X, condition.X,
                       fmt::format("{} line {}", condition.file, condition.line));
  }

  /// The reason why a frame or tool has changed; empty: no job sets it.
  [[nodiscard]] std::string why_set(const std::string& name, const std::string& any) const {
    for (const std::string& one : {name, any}) {
      if (const auto set = set_->find(one); set != set_->end()) return set->second;
    }
    return "";
  }

 public:
  void motion(const Statement& statement, const Displaced& displaced) {
    const std::optional<Motion> motion = inform::motion_of(statement);
    if (!motion) return unknown(statement);
    const bool goes_on = !program_.moves.empty() && program_.moves.back().file == index_ &&
                         last_motion_ == motion->word;
    ProgramMove& move = program_.moves.emplace_back(
        ProgramMove{index_, statement.line, {}, motion->word == "MOVC"});
    move.arc_goes_on = move.is_arc && goes_on;
    move.speed_mm_s = motion->speed_mm_s;
    last_motion_ = motion->word;
    if (const std::string why = why_left(*motion, displaced); !why.empty()) {
      used_.insert(motion->position);
      return leave(program_,
                   {motion->position, index_, statement.line, std::string(motion->word), why},
                   program_.moves.size() - 1);
    }
    const Position& position = text_.positions.at(motion->position);
    if (!motion->external.empty()) external_of_[program_.moves.size() - 1] = motion->external;
    used_.insert(motion->position);
    repeat(statement, *motion, position);
    sites_.add(index_, position.begin, motion->position,
               {tool_of(position), frame_of(position), std::string(motion->word), index_,
                statement.line, program_.moves.size() - 1, motion->word != "MOVJ"});
  }

 private:
  /// The reason why its position cannot be corrected; empty if it can.
  [[nodiscard]] std::string why_left(const Motion& motion, const Displaced& displaced) const {
    if (!motion.ended_by.empty())
      return fmt::format("a sensor may end the motion ({})", motion.ended_by);
    const std::string robot = text_.group.substr(0, text_.group.find(','));
    if (robot.starts_with("RB") && robot != "RB1")
      return fmt::format("the job moves {}, another robot", shown(robot));
    if (motion.word == "IMOV") return "it is relative to where the robot is";
    if (!displaced.shifted.empty())
      return fmt::format("SFTON displaces it ({})", displaced.shifted);
    if (!displaced.sensed.empty())
      return fmt::format("a sensor or a soft axis moves it: {}", displaced.sensed);
    if (!text_.positions.contains(motion.position))
      return "it is a variable, which any job may set";
    return motion.position[0] == 'C' ? "" : "it moves external axes alone";
  }

  /// `SMOVL C00000 ...`, `SYMOVL C00000 ...`: of a part that moves, or more.
  void unknown(const Statement& statement) {
    static const std::set<std::string_view> kStill = {"REFP", "MFRAME", "SETTOOL",
                                                      "CALL", "JUMP",   "PSTART"};
    if (statement.tokens.size() < 2 || kStill.contains(statement.whole_word)) return;
    for (const Token token : statement.tokens) {
      const std::string name(token.text);
      if (name[0] != 'C' || !text_.positions.contains(name)) continue;
      used_.insert(name);
      program_.moves.push_back({index_, statement.line, {}, false});
      leave(program_,
            {name, index_, statement.line, std::string(statement.whole_word),
             fmt::format("{} is not known here: it may move the robot there",
                         shown(statement.whole_word))},
            program_.moves.size() - 1);
    }
  }

  std::size_t index_;
  Program& program_;
  Sites& sites_;
  const ReadOptions& options_;
  ListedValues& listed_;
  inform::JobText text_;
  const Position* last_ = nullptr;  ///< of text_, in the order of the file
  std::set<std::string> used_;
  std::string last_motion_;
  std::map<std::size_t, std::vector<std::string>> external_of_;  ///< names, by the motion
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
      for (Step& step : statement.steps()) {
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

/// Yaskawa's manuals count the wrist in two ways, which are opposite for a tool that points down.
void note_wrist(Program& program) {
  const auto first = std::find_if(
      program.targets.begin(), program.targets.end(),
      [](const ProgramTarget& target) { return target.configuration.bends_down.has_value(); });
  if (first == program.targets.end()) return;
  program.notes.push_back(fmt::format(
      "{} ({} line {}): the first number of RCONF is read by axis B, 1 where it bends the tool "
      "down. Older controllers (NX100) count it by axis R: compare the axes of one position in the "
      "receipt with the pendant before the job runs",
      shown(first->name), program.files[first->file].name, first->line));
}

}  // namespace

Program read_inform(std::vector<SourceFile> files, const ReadOptions& options) {
  Program program;
  program.dialect = "inform";
  program.files = std::move(files);
  Sites sites;
  ListedValues listed = inform::conditions(options.beside);
  std::vector<Job> jobs;
  jobs.reserve(program.files.size());
  for (std::size_t f = 0; f < program.files.size(); ++f)
    jobs.emplace_back(f, program, sites, options, listed);
  read_motions(jobs);
  program.notes = listed.notes();
  sites.finish(program, [&](const Site& site, ProgramTarget& target) {
    return jobs[site.file].describe(site, target);
  });
  note_wrist(program);
  return program;
}

}  // namespace trammel::cam
