#pragma once

#include <optional>
#include <string>

#include "clients/cam/backup/backup.h"
#include "clients/cam/dialect.h"
#include "server/base/result.h"
#include "server/robot/chain.h"

/// The folder with the backup of a controller.
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
/// Builds the robot from the controller's lengths, if it states them. Otherwise takes the shipped
/// robot of the stated type, with the maker's measurements of the individual robot. Refuses, with
/// the type, if there is neither.
[[nodiscard]] Result<BackupRobot> robot_of_backup(const cam::ControllerCell& controller);

}  // namespace trammel::cli
