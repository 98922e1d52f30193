#pragma once

#include <string>
#include <vector>

#include "server/measurement/measurement.h"

/// Set-ups of the instrument. In session s the tracker sees (1 + k(s)) p = X_WS(s)^-1 X_WB f(q) +
/// noise. There is one arm; X_WS(s), the place of the instrument, belongs to the session. The scale
/// k(s) also belongs to it, if the data ask for one: the instrument measures all lengths too long,
/// or the whole arm was colder. W is the world of the newest session, and its lengths are the
/// lengths of W. This also holds if the session with the most poses located the base because the
/// cell does not state it. Isotropic noise stays isotropic under a rigid motion, and practically so
/// under a scale of parts in a million. So measurements may be moved into W as if they were all of
/// one set-up.
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
  double scale = 0;      ///< the relative stretch of its lengths into those of the model; 0: none
  double own_noise = 0;  ///< m, one axis: noise in excess of the other sessions
  double own_noise_rotation = 0;  ///< rad, one axis

  /// Takes measurements of the session into W.
  [[nodiscard]] Similarity into_W() const { return {X_WS, scale}; }
  void set_into_W(const Similarity& by) {
    X_WS = by.X;
    scale = by.scale;
  }

  friend bool operator==(const SessionSetting& a, const SessionSetting& b);
};

/// True if the sessions have scales of their own.
[[nodiscard]] bool are_stretched(const std::vector<SessionSetting>& settings);

/// A setting for each session of the batch, if there are several, with its rows: all in W. Empty
/// for one session.
[[nodiscard]] std::vector<SessionSetting> settings_of(const MeasurementBatch& batch);

/// `batch` as if all had been measured in W. The noise of each session enters the sigmas of its
/// rows (`sigma`, m, and `sigma_rotation`, rad, are used where a row states none). The sessions
/// keep their ids.
[[nodiscard]] MeasurementBatch moved(MeasurementBatch batch,
                                     const std::vector<SessionSetting>& settings, double sigma,
                                     double sigma_rotation);
/// moved(), and then one session. Without settings the batch is returned as it is.
[[nodiscard]] MeasurementBatch aligned(MeasurementBatch batch,
                                       const std::vector<SessionSetting>& settings,
                                       const Tracker& tracker);

/// The reason why the rows do not determine the place of their instrument: fewer than three
/// positions, or all on one line, and no orientation. Empty if they determine it.
[[nodiscard]] std::string why_not_placed(const MeasurementBatch& session);

}  // namespace trammel
