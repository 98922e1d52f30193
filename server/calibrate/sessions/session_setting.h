#pragma once

#include <string>
#include <vector>

#include "server/measurement/measurement.h"

/// Set-ups of the instrument. In a session s the tracker sees (1 + k(s)) p = X_WS(s)^-1 X_WB f(q) +
/// noise: the arm is one, and X_WS(s), where the instrument stood, belongs to the session. So does
/// the scale k(s) where the data ask for it: an instrument that measures all lengths too long, or
/// an arm that was colder as a whole. W is the world of the newest session, and its lengths are
/// those of W (where the cell does not say where the base stands, too: the session with the most
/// poses only finds it). A rigid motion leaves isotropic noise as it is, and so does a scale of
/// parts in a million; so measurements may be moved into W as if all were of one set-up.
namespace trammel {

/// A scale, then a rigid motion: p -> X ((1 + scale) p).
struct Similarity {
  Pose X = Pose::Identity();
  double scale = 0;

  [[nodiscard]] Vector3 operator*(const Vector3& p) const { return X * ((1 + scale) * p); }
  [[nodiscard]] Similarity operator*(const Similarity& first) const;
};

/// The parameters that belong to one session.
struct SessionSetting {
  std::string id;
  int first = 0;           ///< index of its first pose in the batch (PoseContext::index)
  std::string first_pose;  ///< its id
  int poses = 0;
  Pose X_WS = Pose::Identity();  ///< from the session's world into that of the newest
  double scale =
      0;  ///< by what its lengths are to be stretched, of themselves; 0: as the model has them
  double own_noise = 0;           ///< m, one axis: noise beyond that of the other sessions
  double own_noise_rotation = 0;  ///< rad, one axis

  /// Takes what the session measured into W.
  [[nodiscard]] Similarity into_W() const { return {X_WS, scale}; }
  void set_into_W(const Similarity& by) {
    X_WS = by.X;
    scale = by.scale;
  }

  friend bool operator==(const SessionSetting& a, const SessionSetting& b);
};

/// True if the sessions have scales of their own.
[[nodiscard]] bool are_stretched(const std::vector<SessionSetting>& settings);

/// A setting for each of several sessions of the batch, of the rows that it has: all in W. None
/// where it is one.
[[nodiscard]] std::vector<SessionSetting> settings_of(const MeasurementBatch& batch);

/// `batch` as if all had been measured in W, with the noise of each session in the sigmas of its
/// rows (`sigma`, m, and `sigma_rotation`, rad: where a row states none). The sessions are still
/// told apart.
[[nodiscard]] MeasurementBatch moved(MeasurementBatch batch,
                                     const std::vector<SessionSetting>& settings, double sigma,
                                     double sigma_rotation);
/// moved(), and then one session. Without settings the batch is returned as it is.
[[nodiscard]] MeasurementBatch aligned(MeasurementBatch batch,
                                       const std::vector<SessionSetting>& settings,
                                       const Tracker& tracker);

/// Why the rows do not tell where their instrument stood: fewer than three positions, or all on one
/// line, and no orientation. Empty where they do.
[[nodiscard]] std::string why_not_placed(const MeasurementBatch& session);

}  // namespace trammel
