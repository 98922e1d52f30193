#pragma once

#include <set>
#include <string>
#include <vector>

#include "clients/cam/dialect.h"
#include "clients/cam/encoding.h"

namespace trammel::cli {

/// The files of one program, and related files found beside them.
struct ProgramFiles {
  cam::Dialect dialect = cam::Dialect::kRapid;
  std::vector<cam::SourceFile> files;
  std::vector<std::string> paths;        ///< of each file; `-` is standard input
  std::vector<cam::Encoding> encodings;  ///< of each file as it is stored; its text is UTF-8
  bool from_folder = false;              ///< the output is a folder too
  std::set<std::string> system = {};     ///< names of files that belong to the controller and were
                                         ///< found in a folder: read, not written
  std::vector<cam::SourceFile> parameters = {};  ///< MOC.cfg of an ABB backup that a folder is
  std::string task = {};  ///< for RAPID: modules of this task were taken; empty: all tasks
  std::vector<cam::SourceFile> beside =
      {};  ///< read for values alone: other tasks, lists of frames and tools
  std::vector<std::string> not_read =
      {};  ///< files about the robot that are not read: one sentence each
};

}  // namespace trammel::cli
