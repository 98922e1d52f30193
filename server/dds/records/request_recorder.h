#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <string>
#include <thread>

#include "idl/repairs/valid.h"
#include "server/base/mutex.h"
#include "server/base/result.h"
#include "server/dds/records/record_options.h"

namespace trammel {

/// A request and its answer as one line of JSON; README.md lists its members. It does not name the
/// client.
[[nodiscard]] std::string record_line(const wire::PredictErrorRequest& request,
                                      const wire::PredictErrorReply& reply, std::int64_t at_unix_s);
[[nodiscard]] std::string record_line(const wire::CorrectTargetRequest& request,
                                      const wire::CorrectTargetReply& reply,
                                      std::int64_t at_unix_s);

/// Writes predictions and corrections, requests and answers, to a sequence of files, in a thread of
/// its own, so that nobody waits for the disk. Lines that do not fit into its queue are dropped and
/// counted. Thread-safe.
class RequestRecorder {
 public:
  /// Checks that open() could make its folder; makes nothing.
  [[nodiscard]] static Status check(const RecordOptions& options);
  /// Null if recording is off. Makes the folder; refuses one that cannot be written.
  [[nodiscard]] static Result<std::unique_ptr<RequestRecorder>> open(const RecordOptions& options);
  ~RequestRecorder();  ///< writes the waiting lines
  RequestRecorder(const RequestRecorder&) = delete;
  RequestRecorder& operator=(const RequestRecorder&) = delete;

  /// `bytes`: the memory of the data that `line` captures.
  void record(std::function<std::string()> line, std::size_t bytes);
  /// Requests that are in no file: the queue was full, or the disk refused them.
  [[nodiscard]] std::uint64_t dropped() const { return dropped_; }

 private:
  struct Waiting {
    std::function<std::string()> line;
    std::size_t bytes = 0;
  };
  explicit RequestRecorder(RecordOptions options) : options_(std::move(options)) {}
  void run(const std::stop_token& stop);
  void write(const std::string& line);
  void next_file();
  /// Drops a line that the disk took only in part; earlier lines stay. A disk that is full now may
  /// have space later.
  void give_up_file();

  const RecordOptions options_;
  std::atomic<std::uint64_t> dropped_{0};
  Mutex mutex_;
  Condition changed_;
  std::deque<Waiting> waiting_ TRAMMEL_GUARDED_BY(mutex_);
  std::size_t waiting_bytes_ TRAMMEL_GUARDED_BY(mutex_) = 0;
  std::ofstream file_;  // of the thread, as the next two
  std::size_t file_bytes_ = 0;
  std::int64_t number_ = 0;
  std::jthread thread_;
};

}  // namespace trammel
