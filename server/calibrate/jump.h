#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/calibrate/calibration.h"

/// Finds a sudden change in the middle of a batch of one set-up: a joint that loses its zero, or a
/// tool or tracker that is knocked.
namespace trammel {

struct Jump {
  std::string source;   ///< in the spelling of a list of error sources: `joint_slip:3@101`
  std::string pose_id;  ///< the first pose with the jump
  int row = 0;          ///< the row of that pose in its file
  double effect =
      0;  ///< m, rms: the shift of the measured points from that row on, with all else unchanged
  double p_value = 1;  ///< chance of such a gain by the best kind at any row without a jump
  std::vector<std::string> could_also_be = {};  ///< explain it nearly as well
};
/// `from pose p101 (row 102) on: lost zero in joint 3, 0.160 mm rms`
[[nodiscard]] std::string in_words(const Jump& jump);

/// The most strongly supported jump in the poses, in the order of `batch`. Empty if no jump is
/// beyond chance and clearly likelier than slow growth. `found` was identified on the poses as one
/// session, with all sources of the cell free. Each kind of jump at each row is tested against the
/// residuals beside all free parameters (a score test). The model error is not white noise. So the
/// gains are divided by the gains of the same kinds between halves of the joint ranges, after the
/// strongest jump is removed; a joint approached from both sides may differ between the halves. A
/// jump must be 100 times likelier than a wandering of the same kind. The wandering is a sum of
/// half waves over the batch; their amplitudes fall by a power of the wave number, and the data
/// choose the power and the scale. Poses with different tools or payloads are searched separately,
/// since users report these changes. Batches with fewer than 40 poses, or with more than two
/// million derivatives (poses times parameters), are not searched.
[[nodiscard]] std::optional<Jump> jump_within(const CalibrationResult& found,
                                              const MeasurementBatch& batch);

/// Finds a jump in a batch on which nothing was identified yet, with the sources that `cell` lists.
/// Empty also if the batch does not identify them.
[[nodiscard]] std::optional<Jump> jump_within(const std::shared_ptr<const Cell>& cell,
                                              const MeasurementBatch& batch);

}  // namespace trammel
