#pragma once

#include <functional>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "server/measurement/measurement.h"
#include "server/robot/cell.h"

/// First batches of new cells: robots as they are delivered, and the mistakes that their files come
/// with.
namespace trammel::test {

/// The first measurement of a new cell.
struct FirstBatch {
  std::string robot = "abb_irb6640-205-275";  ///< of models/
  bool base_known = true, tool_known = true;
  bool orientation = true;
  int poses = 60;
  double spread = 0.6;   ///< share of each joint's range that is measured
  double length = 2e-3;  ///< m, standard deviation of every length, and of the tool point
  double zero = 0.01;    ///< rad, of every joint's zero
  double twist = 1e-3;   ///< rad, of every axis
  double compliance =
      5e-10;             ///< rad/Nmm, standard deviation of every joint's, under the load of 100 kg
  double noise = 30e-6;  ///< m, of one coordinate
  double outliers = 0;   ///< share of the rows, each off by up to 0.3 m
  double tracker = 2;    ///< m, largest distance of the tracker from the drawn base; it is turned
                         ///< about the vertical, too
  std::uint64_t seed = 1;
};
/// Draws a robot and a batch: 15 to 300 poses, positions alone or full poses, a base and tool that
/// are known or not, errors up to some mm and degrees, noise to 0.2 mm, outliers.
enum class Robots { kOfSixJoints, kAll };
[[nodiscard]] FirstBatch first_batch(std::uint64_t seed, Robots robots);
[[nodiscard]] std::shared_ptr<const Cell> new_cell(const FirstBatch& first);
/// The batch as it came, not yet checked.
[[nodiscard]] MeasurementBatch measured_first(const FirstBatch& first, const Cell& cell);

/// A mistake in a file. `make` makes it and returns the name of the intended reading.
struct Misreading {
  std::string kind;
  bool needs_orientation = false;
  std::function<std::string(MeasurementBatch& batch, const Cell& cell, std::mt19937_64& random)>
      make;
};
[[nodiscard]] const std::vector<Misreading>& misreadings();

/// The refusal of a batch before anything is learned from it: by check_against_cell(), else by
/// batch_doubt(); empty: it is learned from.
[[nodiscard]] std::optional<Error> said_of(MeasurementBatch batch, const Cell& cell);
/// True if the error names the reading.
[[nodiscard]] bool names(const Error& error, const std::string& reading);

}  // namespace trammel::test
