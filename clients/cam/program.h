#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "clients/cam/number_text.h"
#include "server/robot/cell.h"

/// A robot program, whatever controller it is for: files of bytes, and what was understood of them.
/// A reader of a dialect makes it; everything behind the readers is the same for all dialects.
/// Bytes that no reader understood stay.
namespace trammel::cam {

struct SourceFile {
  std::string
      name;  ///< as the receipt shows it: a path, relative to the folder that was handed over
  std::string text;  ///< the bytes, in whatever encoding
};

/// Bytes [begin, end) of a file.
struct Span {
  std::size_t begin = 0, end = 0;
};

/// The numbers of a target in the order and units of its dialect.
enum class Coordinates {
  kQuaternion,      ///< x y z mm, w x y z
  kAnglesZyx,       ///< x y z mm, deg about Z, the new Y, the new X (KUKA A B C)
  kAnglesXyz,       ///< x y z mm, deg about X, Y, Z as they stand (FANUC W P R, Yaskawa Rx Ry Rz)
  kRotationVector,  ///< x y z m, rotation vector rad (Universal Robots)
  kJoints,          ///< axes of the arm, deg
  kJointRadians,    ///< the same, rad
  kJointPulses      ///< the same, as the controller counts its encoders (Yaskawa)
};
[[nodiscard]] bool is_joints(Coordinates coordinates);

/// A number that is written anew.
struct Slot {
  std::size_t value = 0;  ///< which number of the target
  NumberStyle style = {};
};
/// Bytes that are replaced by texts and numbers in turn: texts[0] slots[0] texts[1] ... texts[n].
struct Rewrite {
  Span span;
  std::vector<std::string> texts;  ///< empty: the bytes are one number
  std::vector<Slot> slots;
};

/// A line that is written above one of the text: texts[0] slots[0] texts[1] ... texts[n].
struct NewLine {
  std::size_t at = 0;  ///< a byte of the line that it goes above
  std::vector<std::string> texts;
  std::vector<Slot> slots;
};
/// In texts of a NewLine: the number of a point that the file does not have yet.
constexpr char kNewPoint = '\x01';

/// The numbered points of a file.
struct PointList {
  std::size_t next = 0;     ///< a number that none has, nor any higher one
  int width = 1;            ///< digits of a number, at least
  Span count = {};          ///< the bytes that say how many there are; empty: none do
  std::size_t counted = 0;  ///< what they say
};

/// The arm's configuration at a target, as a program states it. Candidates are the closed-form
/// solutions of a spherical wrist; a dialect scores them.
struct Configuration {
  std::optional<int> conf;  ///< 0..7 as inverse_kinematics.h numbers it
  std::vector<std::optional<double>>
      near;  ///< rad, a value of each joint to be near to; empty: not said
  std::vector<std::optional<int>>
      turns;  ///< of each joint: 0 within ±180 deg, 1 a turn above, -1 below
  std::vector<std::optional<int>> signs;  ///< of each joint: -1 negative, +1 not; empty: not said
  std::optional<bool> behind_axis_1;      ///< wrist centre behind axis 1
  std::optional<bool> elbow_up;           ///< the higher of the two elbows
  std::optional<bool> larger_joint_3;     ///< of the two elbows the one with the larger joint 3
  std::optional<bool>
      bends_down;  ///< with joint 4 near zero the wrist would bend the tool downward

  [[nodiscard]] bool said() const {
    return conf || !near.empty() || !turns.empty() || !signs.empty() || behind_axis_1 || elbow_up ||
           larger_joint_3 || bends_down;
  }
};

/// A load as a program states it.
struct StatedLoad {
  double mass = 0;                ///< kg
  Vector3 p_F = Vector3::Zero();  ///< centre of gravity, m, in F
  bool has_centre = true;         ///< false: only the mass is said
};

/// A tool as the program has it.
struct ProgramTool {
  std::string name;
  std::string file;  ///< empty: not in the files handed over
  int line = 0;
  std::optional<Pose> X_FT;  ///< empty: not known
  std::optional<StatedLoad> load;
  double rotation_rounding = 0;  ///< rad, what its digits leave open
  std::string why_not;           ///< why its targets cannot be corrected; empty: they can
  std::string carries =
      {};  ///< the load that motions set, as the program calls it; empty: `load` is the tool's own
  std::string load_note = {};  ///< why that load cannot be compared
  std::string row = {};        ///< of --frames, that may tell X_FT; empty: none may
  bool from_row = false;       ///< X_FT is what that row says
};

/// A frame that targets are given in. A reader tells it as seen from the controller's world;
/// read_program() makes it seen from the robot's base.
struct ProgramFrame {
  std::string name;
  Pose X_BO = Pose::Identity();
  std::string why_not;   ///< why its targets cannot be corrected; empty: they can
  std::string row = {};  ///< of --frames, that may tell X_BO; empty: none may
  bool in_base =
      false;  ///< the reader has it seen from the robot's base already, as rows of --frames are
};

/// Where the robot stands in the controller's world, and who says so.
struct StatedBase {
  Pose X_WB;
  std::string name;  ///< `$ROBROOT`
  std::string file;
  int line = 0;  ///< 0: not a line of a file
};

/// A number of a robot that its controller's files state, so that another robot than the cell's is
/// found out.
enum class ArmNumber {
  kAxes,
  kHeightOfAxis2,
  kAxis1ToAxis2,
  kAxis2ToAxis3,
  kAxis3ToWrist,
  kWristToFlange
};
struct StatedNumber {
  ArmNumber of = ArmNumber::kAxes;
  double value = 0;  ///< m; of kAxes their number
  std::string name;  ///< `$LENGTH_A`
  std::string file;
  int line = 0;
};

/// The type of a robot as its controller's files state it.
struct StatedType {
  std::string type;  ///< `#KR210R2700 EXTRA C4 FLR`
  std::string name;  ///< `$TRAFONAME`
  std::string file;
  int line = 0;
};

/// An axis that follows another one, as its controller's files state it.
struct StatedCoupling {
  int axis = 0;      ///< of the turning ones, from 0
  std::string name;  ///< `coupled_upper_joint_bound`
  std::string text;  ///< its value
  std::string file;
  int line = 0;
};

/// A target that may be corrected.
struct ProgramTarget {
  std::string name;          ///< `p10`, or how it is computed: `Offs(p10,0,0,50)`
  std::size_t file = 0;      ///< where it is written anew
  int line = 0;              ///< of that place, from 1
  std::string motion;        ///< `MoveL`, of its first use
  std::vector<int> used_at;  ///< lines of the motions to it, in the file of each
  std::size_t tool = 0, frame = 0;
  Coordinates coordinates = Coordinates::kQuaternion;
  std::vector<double> numbers;  ///< of the whole pose, in the dialect's units
  Configuration configuration = {};
  std::map<int, double> external;           ///< mm or deg as stated, by axis from 0
  std::vector<double> pulses_per_deg = {};  ///< of each axis, where its numbers are pulses
  std::vector<Rewrite> rewrites;
  bool folded = false;  ///< was computed by the program from other targets
  std::string comment;  ///< a line to insert above `comment_at`, without its end; empty: none
  std::size_t comment_at = 0;  ///< first byte of a line
  bool linear = false;         ///< the tool's path to it is a line or an arc
};

/// A target that is left as it was.
struct LeftAlone {
  std::string name;
  std::size_t file = 0;
  int line = 0;
  std::string motion;
  std::string why;
};

/// By what a controller chooses among the joints that bring the tool to a pose.
enum class JointChoice {
  kByConfiguration,  ///< as the target says it
  kNearest,          ///< to joints that the motion names, or to those before it
  kOnALine           ///< the posture before stays
};

/// A motion, in the order of the text.
struct ProgramMove {
  std::size_t file = 0;
  int line = 0;
  std::vector<std::size_t> targets;  ///< of Program::targets, that it may go to; empty: left alone
  bool is_arc = false;               ///< to an end by way of another target
  bool arc_goes_on = false;          ///< it is part of the arc of the motion before
  bool left_some = false;            ///< a target of it is left
  std::optional<double> speed_mm_s = {};  ///< of the tool, where the motion says it
  JointChoice choice = JointChoice::kByConfiguration;
  std::vector<double> near = {};  ///< rad, joints that the motion names; empty: none
  std::vector<double> axes =
      {};  ///< deg, where it commands axes, also where these are left; empty: it does not
  std::set<std::size_t> before =
      {};  ///< motions that may be the last before it, as motions_before() has them
  /// Lines that make one more motion of its kind before it, to a place in the coordinates of its
  /// target; empty: it does not stop at its target, or cannot be repeated.
  std::vector<NewLine> another = {};
};

/// A statement reads the stored numbers of a target: what it makes of them moves where the target
/// is corrected.
struct Reading {
  std::size_t file = 0;
  Span of;           ///< the bytes that hold the target
  std::string name;  ///< of the target
  std::size_t by_file = 0;
  int by_line = 0;
  std::string by;       ///< what is made of it: `pX`; empty: something else
  bool motion = false;  ///< it is a motion, which goes to what is made of it
};

/// Which way a program says that up is, as its robot is mounted.
struct StatedUp {
  Vector3 up_B = Vector3::UnitZ();  ///< unit vector, seen from the robot's base
  std::string name;                 ///< `set_gravity`
  std::string file;
  int line = 0;
};

/// The sign that a file is not whole.
struct Cut {
  std::size_t file = 0;
  int line = 0;
  std::string what;  ///< a clause: `PROC main has no ENDPROC`
};

/// Where and how a dialect takes the mark of a correction.
struct MarkPlace {
  std::size_t at = 0;       ///< first byte of the line that it goes above
  std::string begin = "!";  ///< of the comment
  std::string end = {};
  bool a_line_each = false;  ///< for each word of the mark
};

/// The robot, as the controller's own files state it.
struct StatedRobot {
  std::vector<StatedBase> bases;  ///< the first holds
  std::vector<StatedNumber> numbers;
  std::vector<StatedType> types;
  std::vector<StatedCoupling> couplings;
  std::vector<StatedUp> ups;
};

struct Program : StatedRobot {
  std::string dialect;
  std::vector<SourceFile> files;
  std::vector<MarkPlace> mark_places;  ///< one a file
  std::vector<PointList> points;       ///< likewise, where its points are numbered; else empty
  std::vector<ProgramTool> tools;
  std::vector<ProgramFrame> frames;
  std::vector<ProgramTarget> targets;
  std::vector<LeftAlone> left;
  std::vector<ProgramMove> moves;
  std::vector<Reading> readings;
  std::set<int> moved_axes;        ///< external axes that motions move without a target
  std::vector<std::string> notes;  ///< what could not be compared, a sentence each
  std::vector<Cut> cuts;

  /// True if any motion or target was seen in any of the files, be it one that is left as it is.
  [[nodiscard]] bool is_understood() const {
    return !(moves.empty() && targets.empty() && left.empty());
  }
};

struct ReadOptions {
  bool split = false;        ///< a target that is used with two tools or frames becomes two
  bool keep_joints = false;  ///< joint targets stay as they are
  std::map<std::string, Pose> frames =
      {};  ///< values of tools and frames that the files leave open, by name
  std::set<std::string> spared = {};  ///< files that are read and not written
  std::vector<std::string> idle_axes =
      {};                   ///< external axes that carry neither robot nor part, by axis_called()
  StatedRobot stated = {};  ///< by files that are no programs
  std::vector<SourceFile> beside =
      {};  ///< read for what they say of values: other tasks, system variables
  std::vector<double> pulses_per_deg =
      {};  ///< of each axis, as the controller counts them; empty: not told
};

/// Refuses files in UTF-16, lines that end in CR alone (readers count by LF, and comments end with
/// it), and a file that was cut off, whose missing part may decide what the rest means.
[[nodiscard]] Status check_files(const Program& program);

/// The row of --frames that tells where the robot stands in the world that the program's frames are
/// told in.
constexpr const char* kRobotBase = "robot_base";

/// `[0.000, 0.000, 600.000] mm [1.000000, 0.000000, 0.000000, 0.000000]`
[[nodiscard]] std::string pose_text(const Pose& X);
/// `2.500 mm and 0.0000 deg apart`
[[nodiscard]] std::string apart_text(const Pose& a, const Pose& b);

/// True if both are the same place and turn, as far as tools and frames are compared.
[[nodiscard]] bool same_place(const Pose& a, const Pose& b);
/// Why a row of --frames cannot hold beside what the files say at a place, both seen from the same;
/// empty: it can.
[[nodiscard]] std::string against_row(const std::string& row, const Pose& X, const Pose& by_files,
                                      const std::string& place);

/// Gives a tool or frame the value of a row of --frames, which it may have. Whether there is such a
/// row.
bool take_row(const std::string& row, const ReadOptions& options, ProgramTool& tool);
bool take_row(const std::string& row, const ReadOptions& options, ProgramFrame& frame);

/// Names of rows of --frames: those whose values a program has, and those that it still lacks.
struct FramesRows {
  std::set<std::string> used, open;
};
[[nodiscard]] FramesRows rows_of(const Program& program);

/// The number of a tool in the program's list, where it is put if no tool of that name, place and
/// load is there.
std::size_t add_once(Program& program, ProgramTool tool);
/// The number of a frame in the program's list, where it is put if no frame of that name, whatever
/// its case, and pose is there.
std::size_t add_once(Program& program, ProgramFrame frame);
/// `spindle`, `spindle carrying lPart`
[[nodiscard]] std::string called(const ProgramTool& tool);
/// Leaves the targets that stand in files of these names: those that a motion goes to are told,
/// with the reason.
void leave_targets_in(Program& program, const std::set<std::string>& files);
/// Leaves the other target of each arc that one is left of: half an arc corrected is another arc.
void leave_halves_of_arcs(Program& program);

/// The first of Yaskawa's external axes, in pulses: those that carry the robot, and behind them
/// those that carry the part.
constexpr int kFirstBaseAxis = 6, kFirstStationAxis = 12;
/// True if the robot stands elsewhere as soon as the axis is not at zero.
[[nodiscard]] bool carries_robot(const Program& program, int axis);
/// An external axis as a person calls it: `external axis b`, `group 2, axis 1` (FANUC), `base axis
/// 1` (Yaskawa).
[[nodiscard]] std::string axis_called(const Program& program, int axis);
/// Takes axes out of the targets that carry neither robot nor part, called as axis_called() does.
/// Refuses a name that no axis of the program has.
[[nodiscard]] Status take_idle_axes(Program& program, const std::vector<std::string>& names);

/// The number of the line of a byte, from 1.
[[nodiscard]] int line_of(const std::string& text, std::size_t at);
/// The first byte of the line that `at` is in.
[[nodiscard]] std::size_t line_begin(const std::string& text, std::size_t at);

/// The pose that the numbers say, in the target's frame. Joints have none.
[[nodiscard]] Pose pose_of(Coordinates coordinates, const std::vector<double>& numbers);
/// The reverse; angles and quaternions nearest to `like`, the numbers that it replaces.
[[nodiscard]] std::vector<double> numbers_of(Coordinates coordinates, const Pose& pose,
                                             const std::vector<double>& like);

}  // namespace trammel::cam
