#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/calibrate/calibration.h"

/// Finds what begins in the middle of a batch of one set-up: a joint that loses its zero, a tool or
/// a tracker that is knocked.
namespace trammel {

struct Jump {
  std::string source;   ///< as a list of error sources has it: `joint_slip:3@101`
  std::string pose_id;  ///< at which it begins
  int row = 0;          ///< of that pose in its file
  double effect =
      0;  ///< m, rms: how far it moves the measured points from there on, everything else as it was
  double p_value =
      1;  ///< chance that the best of all kinds at all rows explains as much with no jump
  std::vector<std::string> could_also_be = {};  ///< explain it nearly as well
};
/// `from pose p101 (row 102) on: lost zero in joint 3, 0.160 mm rms`
[[nodiscard]] std::string in_words(const Jump& jump);

/// The jump that the poses, in the order of `batch`, speak for most; empty where none is beyond
/// chance and materially likelier than what grows slowly. `found` was identified on them as one
/// session, everything the cell lists free. Each kind of jump at each row is held against the
/// residuals beside all that is free (a score test). What the model leaves over is no white noise,
/// so the gains are divided by what the same kinds gain between halves of the joint ranges once the
/// strongest jump is taken off, and a joint that is approached from both sides may differ between
/// them. It must be 100 times likelier than the same kind wandering: half waves over the batch, of
/// amplitudes that fall with their number by a power, and by a size, that the data choose. Of
/// several tools or payloads each is looked at by itself: who changes one says so. Fewer than 40
/// poses, and more than two million derivatives (poses times parameters), are not looked at.
[[nodiscard]] std::optional<Jump> jump_within(const CalibrationResult& found,
                                              const MeasurementBatch& batch);

/// Finds a jump in a batch that nothing was identified on yet, with the sources that `cell` lists.
/// Empty also where they cannot be identified on it.
[[nodiscard]] std::optional<Jump> jump_within(const std::shared_ptr<const Cell>& cell,
                                              const MeasurementBatch& batch);

}  // namespace trammel
