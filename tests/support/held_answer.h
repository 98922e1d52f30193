#pragma once

#include <sys/types.h>

#include <chrono>
#include <string>
#include <thread>
#include <vector>

#include "server/base/mutex.h"
#include "tests/support/temporary_folder.h"

namespace trammel::test {

/// Sits between servers and a PostgreSQL, and withholds the confirmation of a commit, as if the
/// server died between the commit and its answer.
class HeldAnswer {
 public:
  /// `url`: of a database that is reached by a socket in a folder.
  explicit HeldAnswer(const std::string& url);
  ~HeldAnswer();
  HeldAnswer(const HeldAnswer&) = delete;
  HeldAnswer& operator=(const HeldAnswer&) = delete;

  /// The URL of the same database through this object.
  [[nodiscard]] const std::string& url() const { return url_; }
  /// Lets the next transaction with `statement` be committed without an answer to its client.
  void hold(const std::string& statement);
  /// Until one is: the process that waits for its answer; 0: `limit` is over first.
  [[nodiscard]] pid_t held(std::chrono::milliseconds limit);

 private:
  struct Link {
    int client = -1, server = -1;
    bool is_to_be_held = false, is_held = false;
  };
  void carry();
  void accept_one();
  /// False: one side has left.
  [[nodiscard]] bool carry_to_server(Link& link);
  [[nodiscard]] bool carry_to_client(Link& link);

  TemporaryFolder folder_;
  std::string behind_, url_;  // the socket of the database; the database through this
  int listener_ = -1, end_ = -1;
  std::vector<Link> links_;  // of the thread
  Mutex mutex_;
  Condition changed_;
  std::string statement_ TRAMMEL_GUARDED_BY(mutex_);  // empty: nothing is to be held
  pid_t held_ TRAMMEL_GUARDED_BY(mutex_) = 0;
  std::thread thread_;
};

}  // namespace trammel::test
