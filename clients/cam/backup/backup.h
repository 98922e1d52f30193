#pragma once

#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "clients/cam/program.h"
#include "server/robot/cell.h"

/// A cell as an ABB controller has it: its backup holds the system parameters (SYSPAR/MOC.cfg) and the modules.
namespace trammel::cam {

/// A tool, work object or load of a module.
struct StatedTool {
  Pose X_FT = Pose::Identity();
  std::optional<StatedLoad> load;  ///< empty where it is a placeholder
  std::string where;               ///< `TASK1/SYSMOD/user.sys line 12`
};

struct ControllerCell {
  std::string unit;                               ///< mechanical unit: `ROB_1`
  std::string robot_type;                         ///< as the parameters name it
  Pose X_WB = Pose::Identity();                   ///< base frame, seen from the controller's world
  std::vector<std::pair<double, double>> limits;  ///< rad, of each axis; empty where the parameters do not say all
  bool controller_compensates = false;            ///< Absolute Accuracy is in use
  std::map<std::string, StatedTool> tools;        ///< that the robot holds, by name
  std::map<std::string, Pose> frames;             ///< X_BO of work objects that stand still, by name
  std::map<std::string, StatedLoad> loads;        ///< loaddata
  std::vector<std::string> notes;                 ///< what was passed over, and why
};

/// `parameters`: the text of MOC.cfg, called `where` in errors. `unit`: the robot; empty: the only one. Refuses
/// parameters without a robot, several robots where none is chosen, numbers that are none, and a tool that has two
/// values in the modules; a work object or load that has two is left out, with a note. W of the backup's numbers is the
/// controller's world.
[[nodiscard]] Result<ControllerCell> read_backup(const std::string& parameters, const std::string& where,
                                                 const std::vector<SourceFile>& modules, const std::string& unit);

/// A cell file (YAML) of it. `robot`: the path of the robot file, as it is to stand there.
[[nodiscard]] std::string cell_file_of(const ControllerCell& controller, const std::string& name,
                                       const std::string& robot);

/// One sentence for each thing of the controller that an existing cell has otherwise, with both values and how far they
/// are apart.
[[nodiscard]] std::vector<std::string> differences(const ControllerCell& controller, const Cell& cell,
                                                   bool cell_compensates);

}  // namespace trammel::cam
