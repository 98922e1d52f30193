#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

/// What a session is asked and answers. Units as on the wire: mm, rad; a prismatic joint in mm.
namespace trammel::client {

/// What a call is about; must fit what the model was trained on.
struct CallContext {
  std::string cell;
  std::string tool;     ///< empty: the cell's only one
  std::string payload;  ///< empty: the cell's only one
  bool controller_compensates = false;
  std::string model;  ///< empty: the model in force; else `@version` or a model id that must be the one in force
};

struct PoseMm {
  double x_mm = 0, y_mm = 0, z_mm = 0;
  double qw = 1, qx = 0, qy = 0, qz = 0;
};

/// Which model answered.
struct ModelInfo {
  std::string cell, id, hash, level, batch_id;
  int version = 0;
  std::int64_t trained_at_unix_s = 0;
  double data_age_s = 0;  ///< of its newest measurement, now
  int training_poses = 0;
  double validation_rms_mm = 0;
  bool in_force = false;
};

struct PredictedError {
  PoseMm nominal, predicted;  ///< X_BT
  double dx_mm = 0, dy_mm = 0, dz_mm = 0;
  double sx_mm = 0, sy_mm = 0, sz_mm = 0;
  bool in_domain = false;
};

struct TargetMm {
  PoseMm pose;                   ///< ignored for a joint target
  std::vector<double> seed_rad;  ///< empty when `conf` says the branch
  std::optional<int> conf;
  bool joint_target = false;
};

struct CorrectedTarget {
  std::string status;  ///< `ok`, `out_of_domain`, ... as in files
  PoseMm commanded;
  std::vector<double> q_rad;
  double error_before_mm = 0, error_after_mm = 0, sigma_mm = 0;
  int iterations = 0;
  std::string message;
};

template <typename T>
struct Answer {
  ModelInfo model;  ///< all items come from this one
  std::vector<T> items;
};

struct JobStatus {
  std::int64_t job = 0;
  std::string cell, stage, what;  ///< stage: `queued training storing done failed`
  double share = 0;
  int model_version = 0;
  bool in_force = false;
};

/// A job with what was asked for and when; times are Unix time, s, empty: not yet, or not recorded.
struct DatedJob {
  JobStatus status;
  std::string server, kind;  ///< kind: `train diagnose`
  std::vector<std::string> batches;
  std::int64_t created_unix_s = 0;
  std::optional<std::int64_t> started_unix_s, finished_unix_s;
};

/// What a diagnosis found.
struct DiagnosisAnswer {
  std::string findings_json;  ///< as `trammel diagnose --json` prints them
  std::string page_html;      ///< opens by itself; empty where it was not asked for, or is too old
  ModelInfo in_force;         ///< now; empty id: none
};

/// A batch that no training takes, and why.
struct QuarantinedBatch {
  std::string cell, batch, reason;
  int poses = 0;
};

struct ServerStatus {
  std::string server_id, version, state;
  std::vector<std::string> cells;
  std::uint64_t requests = 0, refused = 0;
  double uptime_s = 0;
  int queued_jobs = 0;
};

}  // namespace trammel::client
