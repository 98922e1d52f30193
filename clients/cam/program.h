#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "clients/cam/number_text.h"
#include "server/robot/cell.h"

/// A robot program for any controller: the bytes of its files, and the parts that were understood.
/// A reader for each dialect makes it; all later steps are the same for all dialects. Bytes that
/// the reader did not understand stay unchanged.
namespace trammel::cam {

struct SourceFile {
  std::string name;  ///< in the form of the receipt: a path relative to the given folder
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

/// A line to insert above a line of the text: texts[0] slots[0] texts[1] ... texts[n].
struct NewLine {
  std::size_t at = 0;  ///< a byte of the line below it
  std::vector<std::string> texts;
  std::vector<Slot> slots;
};
/// In texts of a NewLine: the number of a point that the file does not have yet.
constexpr char kNewPoint = '\x01';

/// The numbered points of a file.
struct PointList {
  std::size_t next = 0;     ///< a number above all numbers in the file
  int width = 1;            ///< least number of digits
  Span count = {};          ///< the bytes with the number of points; empty: there are none
  std::size_t counted = 0;  ///< the number in these bytes
};

/// The arm's configuration at a target, as a program states it. Candidates are the closed-form
/// solutions of a spherical wrist; a dialect scores them.
struct Configuration {
  std::optional<int> conf;  ///< 0..7 as inverse_kinematics.h numbers it
  std::vector<std::optional<double>>
      near;  ///< rad, a value of each joint to be near to; empty if not stated
  std::vector<std::optional<int>>
      turns;  ///< of each joint: 0 within ±180 deg, 1 a turn above, -1 below
  std::vector<std::optional<int>> signs;  ///< of each joint: -1 negative, +1 not; empty if not
                                          ///< stated
  std::optional<bool> behind_axis_1;      ///< wrist centre behind axis 1
  std::optional<bool> elbow_up;           ///< the higher of the two elbows
  std::optional<bool> larger_joint_3;  ///< true: of the two elbows the one with the larger joint 3
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
  bool has_centre = true;         ///< false: only the mass is stated
};

/// A tool in the form in which the program has it.
struct ProgramTool {
  std::string name;
  std::string file;  ///< empty: not in the files handed over
  int line = 0;
  std::optional<Pose> X_FT;  ///< empty: not known
  std::optional<StatedLoad> load;
  double rotation_rounding = 0;  ///< rad, the rounding of its digits
  std::string why_not;           ///< why its targets cannot be corrected; empty: they can
  std::string carries =
      {};  ///< the load that motions set, as the program calls it; empty: `load` is the tool's own
  std::string load_note = {};  ///< why that load cannot be compared
  std::string row = {};        ///< the row of --frames that may give X_FT; empty: none may
  bool from_row = false;       ///< X_FT comes from that row
};

/// A frame of targets. A reader gives it in the controller's world; read_program() converts it into
/// the robot's base.
struct ProgramFrame {
  std::string name;
  Pose X_BO = Pose::Identity();
  std::string why_not;   ///< why its targets cannot be corrected; empty: they can
  std::string row = {};  ///< the row of --frames that may give X_BO; empty: none may
  bool in_base =
      false;  ///< the frame is already relative to the robot's base, as rows of --frames are
};

/// The robot's place in the controller's world, and its origin.
struct StatedBase {
  Pose X_WB;
  std::string name;  ///< `$ROBROOT`
  std::string file;
  int line = 0;  ///< 0: not a line of a file
};

/// A number of a robot in its controller's files, which reveals a robot other than the cell's.
enum class ArmNumber {
  kAxes,
  kHeightOfAxis2,
  kAxis1ToAxis2,
  kAxis2ToAxis3,
  kAxis3ToWrist,
  kWristToFlange,
  kTiltOfFlange
};
struct StatedNumber {
  ArmNumber of = ArmNumber::kAxes;
  double value = 0;  ///< m; of kAxes their number, of kTiltOfFlange rad
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

/// The end of an axis' range as the controller's files state it.
struct StatedLimit {
  int axis = 0;  ///< of the turning ones, from 0
  bool upper = false;
  double value = 0;  ///< rad
  std::string name;  ///< `$SOFTP_END[3]`
  std::string file;
  int line = 0;
};

/// A target that may be corrected.
struct ProgramTarget {
  std::string name;          ///< `p10`, or how it is computed: `Offs(p10,0,0,50)`
  std::size_t file = 0;      ///< the place to rewrite
  int line = 0;              ///< the line of that place, from 1
  std::string motion;        ///< `MoveL`, of its first use
  std::vector<int> used_at;  ///< lines of the motions to it, in each motion's file
  std::size_t tool = 0, frame = 0;
  Coordinates coordinates = Coordinates::kQuaternion;
  std::vector<double> numbers;  ///< of the whole pose, in the dialect's units
  Configuration configuration = {};
  std::map<int, double> external;           ///< mm or deg as stated, by axis from 0
  std::vector<double> pulses_per_deg = {};  ///< for each axis, if its numbers are pulses
  std::vector<Rewrite> rewrites;
  bool folded = false;  ///< was computed by the program from other targets
  std::string comment;  ///< a line to insert above `comment_at`, without its end; empty: none
  std::size_t comment_at = 0;  ///< first byte of a line
  bool linear = false;         ///< the tool's path to it is a line or an arc
};

/// A target that is left alone.
struct LeftAlone {
  std::string name;
  std::size_t file = 0;
  int line = 0;
  std::string motion;
  std::string why;
};

/// The criterion by which a controller chooses among the joints that bring the tool to a pose.
enum class JointChoice {
  kByConfiguration,  ///< the configuration in the target
  kNearest,          ///< nearest to joints in the motion, or to the previous joints
  kOnALine           ///< the posture before stays
};

/// A motion, in the order of the text.
struct ProgramMove {
  std::size_t file = 0;
  int line = 0;
  std::vector<std::size_t> targets;  ///< indices in Program::targets to which it may go; empty:
                                     ///< left alone
  bool is_arc = false;               ///< to an end by way of another target
  bool arc_goes_on = false;          ///< it is part of the arc of the previous motion
  bool left_some = false;            ///< a target of it is left alone
  std::optional<double> speed_mm_s = {};  ///< of the tool, if the motion states it
  JointChoice choice = JointChoice::kByConfiguration;
  std::vector<double> near = {};  ///< rad, joints that the motion names; empty: none
  std::vector<double> axes =
      {};  ///< deg, if it commands axes, even where these are left alone; empty: it does not
  std::set<std::size_t> before =
      {};  ///< motions that may be the last before it, as motions_before() has them
  /// Lines for an additional motion of the same kind before it, to a place in the coordinates of
  /// its target. Empty if the motion does not stop at its target, or cannot be repeated.
  std::vector<NewLine> another = {};
};

/// A statement that reads the stored numbers of a target: its result moves when the target is
/// corrected.
struct Reading {
  std::size_t file = 0;
  Span of;           ///< the bytes that hold the target
  std::string name;  ///< of the target
  std::size_t by_file = 0;
  int by_line = 0;
  std::string by;       ///< its result: `pX`; empty: another kind of result
  bool motion = false;  ///< it is a motion, which goes to the result
};

/// The upward direction according to the program's mounting of the robot.
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

/// The place and the form of the correction mark in a dialect.
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
  std::vector<StatedLimit> limits;
  std::vector<StatedUp> ups;
};

struct Program : StatedRobot {
  std::string dialect;
  std::vector<SourceFile> files;
  std::vector<MarkPlace> mark_places;  ///< one a file
  std::vector<PointList> points;       ///< likewise, if its points are numbered; else empty
  std::vector<ProgramTool> tools;
  std::vector<ProgramFrame> frames;
  std::vector<ProgramTarget> targets;
  std::vector<LeftAlone> left;
  std::vector<ProgramMove> moves;
  std::vector<Reading> readings;
  std::set<int> moved_axes;        ///< external axes that motions move without a target
  std::vector<std::string> notes;  ///< values that could not be compared, one sentence each
  std::vector<Cut> cuts;

  /// True if any motion or target was seen in any of the files, even one that is left alone.
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
  StatedRobot stated = {};  ///< from files that are not programs
  std::vector<SourceFile> beside =
      {};  ///< files read only for their values: other tasks, system variables
  std::vector<double> pulses_per_deg =
      {};  ///< of each axis, as the controller counts them; empty: not told
};

/// Refuses files in UTF-16, lines that end in CR alone (readers count by LF, and comments end with
/// it), and a truncated file, whose missing part may decide the meaning of the rest.
[[nodiscard]] Status check_files(const Program& program);

/// The row of --frames with the robot's place in the world of the program's frames.
constexpr const char* kRobotBase = "robot_base";

/// `[0.000, 0.000, 600.000] mm [1.000000, 0.000000, 0.000000, 0.000000]`
[[nodiscard]] std::string pose_text(const Pose& X);
/// `2.500 mm and 0.0000 deg apart`
[[nodiscard]] std::string apart_text(const Pose& a, const Pose& b);

/// True if both are the same place and turn, within the tolerance for tools and frames.
[[nodiscard]] bool same_place(const Pose& a, const Pose& b);
/// The contradiction between a row of --frames and the files at one place, both in the same frame;
/// empty: none.
[[nodiscard]] std::string against_row(const std::string& row, const Pose& X, const Pose& by_files,
                                      const std::string& place);

/// Gives a tool or frame the value of its row in --frames. Returns whether the row exists.
bool take_row(const std::string& row, const ReadOptions& options, ProgramTool& tool);
bool take_row(const std::string& row, const ReadOptions& options, ProgramFrame& frame);

/// Names of rows of --frames: those whose values the program has, and those that are still missing.
struct FramesRows {
  std::set<std::string> used, open;
};
[[nodiscard]] FramesRows rows_of(const Program& program);

/// The number of a tool in the program's list. The tool is added if the list has no tool with that
/// name, place and load.
std::size_t add_once(Program& program, ProgramTool tool);
/// The number of a frame in the program's list. The frame is added if the list has no frame with
/// that pose and that name in any case.
std::size_t add_once(Program& program, ProgramFrame frame);
/// `spindle`, `spindle carrying lPart`
[[nodiscard]] std::string called(const ProgramTool& tool);
/// Leaves the targets in files of these names alone; those with a motion are reported with the
/// reason.
void leave_targets_in(Program& program, const std::set<std::string>& files);
/// Leaves the second target of an arc alone if the first one is: correcting half an arc makes
/// another arc.
void leave_halves_of_arcs(Program& program);

/// The first of Yaskawa's external axes, in pulses: first those that carry the robot, then those
/// that carry the part.
constexpr int kFirstBaseAxis = 6, kFirstStationAxis = 12;
/// True if the robot stands elsewhere as soon as the axis is not at zero.
[[nodiscard]] bool carries_robot(const Program& program, int axis);
/// An external axis as a person calls it: `external axis b`, `group 2, axis 1` (FANUC), `base axis
/// 1` (Yaskawa).
[[nodiscard]] std::string axis_called(const Program& program, int axis);
/// Removes axes that carry neither robot nor part from the targets. `names` are as axis_called()
/// gives them. Refuses a name that no axis of the program has.
[[nodiscard]] Status take_idle_axes(Program& program, const std::vector<std::string>& names);

/// The number of the line of a byte, from 1.
[[nodiscard]] int line_of(const std::string& text, std::size_t at);
/// The first byte of the line that `at` is in.
[[nodiscard]] std::size_t line_begin(const std::string& text, std::size_t at);

/// The pose that the numbers describe, in the target's frame. Joints have none.
[[nodiscard]] Pose pose_of(Coordinates coordinates, const std::vector<double>& numbers);
/// The reverse; angles and quaternions nearest to `like`, the numbers that it replaces.
[[nodiscard]] std::vector<double> numbers_of(Coordinates coordinates, const Pose& pose,
                                             const std::vector<double>& like);

}  // namespace trammel::cam
