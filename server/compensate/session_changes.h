#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/compensate/compensated_model.h"

namespace trammel {

/// The change of the arm between two sessions that a model was made from.
struct SessionChange {
  /// A number of the change, in the unit for people: an angle in degrees, a length in mm.
  struct Size {
    std::string name, unit;
    double value = 0, u95 = 0;  ///< U(k = 2)
  };
  enum class Course {
    kSince,      ///< from that session on
    kThatAlone,  ///< in that session only; the later ones are as before it
    kWanders     ///< from session to session, a random walk; `sizes`: how far since the session
  };
  std::string source;  ///< in the spelling of a list of error sources: `joint_slip:3@121`
  std::string cause;   ///< as the contract spells it: `joint_slip`
  std::optional<int> joint;
  Course course = Course::kSince;
  std::string session_id, pose_id;  ///< since when
  double rate = 0;                  ///< deg per session, for a wandering zero
  std::vector<Size> sizes;
  double strength = 0;  ///< twice the log likelihood that it adds
  double p_value = 1;
  std::vector<std::string> could_also_be;  ///< sources that explain it nearly as well
  bool rests_on_order = false;             ///< on the order of the sessions, which no clock gave
};
/// The parameters that were identified from several sessions.
struct IdentifiedTogether {
  const PhysicalModel& physics;
  const std::vector<IdentifiedParameter>& parameters;
  const Eigen::MatrixXd& covariance;
  const std::vector<SessionSetting>& sessions;
  const std::vector<Change>& changes;  ///< their sources are among those of the physics
  bool as_given = false;               ///< ModelParts::sessions_as_given
};
/// In the order in which they were found.
[[nodiscard]] std::vector<SessionChange> session_changes(const IdentifiedTogether& found);
[[nodiscard]] std::vector<SessionChange> session_changes(const CompensatedModel& model);

/// For people: `since session lt-08 (pose p1): lost zero in joint 3 (q3 -0.01146 ± 0.00023 deg;
/// U, k=2)`.
[[nodiscard]] std::string sentence(const SessionChange& change);

/// The note that the order of the sessions decides which are before a change, which are after it,
/// and which one is today's. Empty if the instruments' clocks gave the order, and with one session.
[[nodiscard]] std::optional<std::string> note_on_order(const std::vector<SessionSetting>& sessions,
                                                       bool as_given);

/// A source as the contract names it: the cause, and the joint where it concerns one.
struct NamedCause {
  std::string cause;
  std::optional<int> joint;
};
[[nodiscard]] NamedCause named_cause(const std::string& source);

/// A source for people, without the row at which it began: `lost zero in joint 3`.
[[nodiscard]] std::string cause_in_words(const std::string& source);

}  // namespace trammel
