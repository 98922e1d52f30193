#pragma once

#include <optional>
#include <string>

#include "clients/cam/backup/backup.h"
#include "clients/cam/dialect.h"
#include "server/base/result.h"
#include "server/robot/chain.h"

/// The folder that a controller was backed up to.
namespace trammel::cli {

struct BackupPlace {
  std::string folder;
  std::string unit;  ///< robot of an ABB backup; empty: its only one
  std::string task;  ///< whose modules are read; empty: all
};

/// Whose controller it is, by files that only his have; empty: nobody's that is known.
[[nodiscard]] std::optional<cam::Dialect> maker_of(const std::string& folder);
/// True if the folder holds lists or parameters of a controller, not programs alone.
[[nodiscard]] bool is_backup(const std::string& folder);

/// What the controller's own files say of its cell. Refuses what read_backup() and read_own_lists()
/// do.
[[nodiscard]] Result<cam::ControllerCell> read_controller(const BackupPlace& place);

/// Work objects and where the robot stands, as --frames of `correct` reads them (CSV). A program
/// uses a few of them.
[[nodiscard]] std::string frames_csv(const cam::ControllerCell& controller);

/// The robot of a controller, and where its numbers come from.
struct BackupRobot {
  Chain arm;
  std::string source;
};
/// By the lengths that the controller tells, else the shipped robot of the type that it names, with
/// what its maker measured at it. Refuses with the type where neither is there.
[[nodiscard]] Result<BackupRobot> robot_of_backup(const cam::ControllerCell& controller);

}  // namespace trammel::cli
