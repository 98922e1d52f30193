#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "clients/session/session.h"
#include "server/compensate/compensated_model.h"
#include "tests/benchmarks/year/plant.h"

/// The work of a metrologist in a week, by what the service says and nothing else.
namespace trammel::year {

/// A cause as a check or a diagnosis calls it.
struct Named {
  std::string cause;
  int joint = 0;  ///< 1-based; 0: none
};

/// The service's answers on a cell in a week.
struct Said {
  bool changed = false, cannot_tell = false;
  bool in_force = false;  ///< a diagnosis has put a model in force
  std::vector<std::vector<Named>> seen =
      {};  ///< by change: what it is called, and what it could also be
  std::string sentence = {};
};

/// The fate of a batch.
struct Taken {
  std::string verdict;  ///< of its job, or the error's sentence
  int version = 0;      ///< that it made; 0: none
  bool in_force = false, quarantined = false;
};

class Metrologist {
 public:
  Metrologist(const Arm& arm, client::Session& session);

  /// A check of twelve poses, with the tracker wherever it stands.
  [[nodiscard]] Said check(int week);
  /// A batch with enough poses to train from.
  [[nodiscard]] Taken measure(int week, int poses);
  /// Sends a batch; a job that was broken off by a server that died is followed on the next one.
  [[nodiscard]] Taken submit(const std::string& id, const MeasurementBatch& batch);
  /// The batch does not fit the model in force, and a check has said why: it is trained from all
  /// the same.
  [[nodiscard]] Taken release();
  /// Follows the job of a batch that is there already.
  [[nodiscard]] Taken follow(std::int64_t job);
  /// Asks what is wrong by the last batch, lets what is sure go into the model, and says what it
  /// was.
  [[nodiscard]] Said diagnose();
  /// The version in force; 0: none.
  [[nodiscard]] int in_force() const;
  /// The last batch that was measured, as it is on disk.
  [[nodiscard]] const MeasurementBatch& last() const { return last_; }

 private:
  const Arm& arm_;
  client::Session& session_;
  Eigen::MatrixXd check_poses_;
  MeasurementBatch last_;
  std::string last_id_;
};

/// A hole of a program.
struct Hole {
  bool warned = false;  ///< not corrected, out of the domain, or perhaps out of tolerance
  double error = 0;     ///< m, of the tool from where it was wanted
  double promised = 0;  ///< m, rms, as the service said
};

/// Drills: asks the service for corrected targets, and looks where the tool really goes.
class Driller {
 public:
  Driller(const Arm& arm, client::Session& session, double tolerance)
      : arm_(arm), session_(session), limit_(tolerance) {}
  /// `count` holes in that week; empty: no answer, or no model.
  [[nodiscard]] std::vector<Hole> drill(int week, int count, std::uint64_t seed) const;
  /// m, rms over the joint ranges of what the model in force gets wrong of the arm.
  [[nodiscard]] std::optional<double> error_in_force(int week) const;
  /// The true error of a model that nobody serves.
  [[nodiscard]] double error_of(const CompensatedModel& model, int week) const;

 private:
  [[nodiscard]] client::CallContext context() const;
  [[nodiscard]] std::optional<Eigen::Matrix3Xd> predicted(const Eigen::MatrixXd& q, int week) const;

  const Arm& arm_;
  client::Session& session_;
  double limit_;
};

}  // namespace trammel::year
