#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "clients/cam/dialect.h"
#include "clients/cam/program.h"
#include "server/robot/cell.h"

/// A cell as its controller has it. The backup of an ABB controller has the system parameters
/// (SYSPAR/MOC.cfg) and the modules; that of another maker has lists of its own.
namespace trammel::cam {

/// A value that the maker measured at this arm and keeps in the controller.
struct FactoryValue {
  std::string part;  ///< `arm`, `joint` or `tool`
  int axis = 0;      ///< from 1; 0: of none
  std::string name;  ///< `error_offset_z`
  double value = 0;  ///< in the unit
  std::string unit;  ///< `m`, `rad`, `rad/Nm`
};

/// A robot as the system parameters have it.
struct ControllerRobot {
  std::string maker = "ABB";
  std::string unit;                       ///< mechanical unit: `ROB_1`
  std::string robot_type;                 ///< the name in the parameters
  std::string file;                       ///< the parameters
  int line = 0;                           ///< the line of the robot in the file
  int axes = 0;                           ///< the number of axes in the file; 0: not known
  Pose X_WB = Pose::Identity();           ///< base frame, seen from the controller's world
  std::vector<StatedCoupling> couplings;  ///< axes that follow another one
  std::string carried_by;                 ///< the unit that moves the base frame; empty: none does
  std::vector<std::pair<double, double>>
      limits;                           ///< rad, of each axis; empty unless the parameters give all
  bool controller_compensates = false;  ///< Absolute Accuracy is in use
  std::vector<std::string> notes;       ///< skipped items, with the reason
  StatedRobot stated = {};  ///< the robot in the files' own form (KUKA); otherwise from the members
                            ///< above
  std::optional<Chain> arm = {};  ///< where the files tell lengths, senses and limits
  std::string why_no_arm =
      "the files of its controller do not tell lengths";  ///< a clause; of no use where there is
                                                          ///< one
  std::vector<FactoryValue> factory = {};
  std::vector<double> compliances = {};  ///< rad/Nm, of each axis by its maker; empty: not told
};

/// `parameters`: the text of MOC.cfg, called `where` in errors. `unit`: the robot; empty: the only
/// one. Refuses parameters without a robot, several robots without a choice (`next` explains how to
/// choose), and values that are not numbers.
[[nodiscard]] Result<ControllerRobot> read_controller_robot(const std::string& parameters,
                                                            const std::string& where,
                                                            const std::string& unit,
                                                            const std::string& next);
/// The robot of a RAPID task, by their numbers: `ROB_2` for `TASK2`. Empty: no robot has that
/// number, or there is only one robot.
[[nodiscard]] std::string unit_of_task(const std::string& parameters, const std::string& task);
/// The robot's place (unless another unit carries it), its axes and its type.
[[nodiscard]] StatedRobot stated_by(const ControllerRobot& robot);
/// Refuses parameters of a robot of another type, or with another number of axes.
[[nodiscard]] Status check_robot(const ControllerRobot& controller, const Chain& robot);

/// A tool of a module.
struct StatedTool {
  Pose X_FT = Pose::Identity();
  std::optional<StatedLoad> load;  ///< empty where it is a placeholder
  std::string where;               ///< `TASK1/SYSMOD/user.sys line 12`
  int number = 0;                  ///< by which a program selects it (KUKA); 0: by its name
};

struct ControllerCell : ControllerRobot {
  std::map<std::string, StatedTool> tools;  ///< the tools that the robot holds, by name
  std::map<std::string, Pose> frames;       ///< X_BO of work objects that stand still, by name
  std::map<std::string, StatedLoad> loads;  ///< loaddata
};

/// The robot, and the data declared in the modules. Refuses the same as read_controller_robot(),
/// and a tool with two values in the modules; a work object or load with two values is left out,
/// with a note. In the backup's numbers W is the controller's world.
[[nodiscard]] Result<ControllerCell> read_backup(const std::string& parameters,
                                                 const std::string& where,
                                                 const std::vector<SourceFile>& modules,
                                                 const std::string& unit);

/// The arm with what its maker measured at it that has a place in a robot file: the compliances of
/// its axes, as a first guess.
[[nodiscard]] Chain with_compliances(const Chain& arm, const std::vector<double>& compliances);

/// The names of the files that state a robot's type in addition to the lists, in lower case:
/// SYSVARS.VA, SUMMARY.DG and VERSION.DG of a FANUC, SYSTEM.SYS of a Yaskawa.
[[nodiscard]] std::set<std::string> type_files_of(Dialect dialect);
/// The names of the files that read_own_lists() takes, in lower case; empty: none are known.
[[nodiscard]] std::set<std::string> own_lists_of(Dialect dialect);
/// The cell from the controller's own lists: `$machine.dat` and `$config.dat` of a KUKA,
/// SYSFRAME.VA of a FANUC, TOOL.CND and UFRAME.CND of a Yaskawa. Refuses lists without a tool.
/// Missing information becomes a note.
[[nodiscard]] Result<ControllerCell> read_own_lists(Dialect dialect,
                                                    const std::vector<SourceFile>& files);

/// What a cell file states in addition to the controller's files.
struct CellFileOptions {
  std::string name;
  std::string robot;            ///< path of the robot file, as it is to stand there
  bool base_from_data = false;  ///< the instrument stands elsewhere than the controller's world
  std::optional<Workspace> workspace = {};
};
/// A cell file (YAML) of it.
[[nodiscard]] std::string cell_file_of(const ControllerCell& controller,
                                       const CellFileOptions& options);

/// The cell according to the program alone: the tools and frames in its files, and the robot if the
/// files name it.
[[nodiscard]] ControllerCell cell_of_program(const Program& program);

/// One sentence for each value in which an existing cell differs from the controller, with both
/// values and their difference.
[[nodiscard]] std::vector<std::string> differences(const ControllerCell& controller,
                                                   const Cell& cell, bool cell_compensates);

}  // namespace trammel::cam
