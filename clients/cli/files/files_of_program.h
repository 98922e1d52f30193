#pragma once

#include <set>
#include <string>
#include <vector>

#include "clients/cam/dialect.h"
#include "clients/cam/encoding.h"

namespace trammel::cli {

/// The files of one program, and what was found beside them.
struct ProgramFiles {
  cam::Dialect dialect = cam::Dialect::kRapid;
  std::vector<cam::SourceFile> files;
  std::vector<std::string> paths;        ///< of each file; `-` is standard input
  std::vector<cam::Encoding> encodings;  ///< of each file as it is stored; its text is UTF-8
  bool from_folder = false;              ///< the output is a folder too
  std::set<std::string> system = {};     ///< names of files that belong to the controller and were
                                         ///< found in a folder: read, not written
  std::vector<cam::SourceFile> parameters = {};  ///< MOC.cfg of an ABB backup that a folder is
  std::string task = {};  ///< of RAPID, whose modules were taken; empty: of all
  std::vector<cam::SourceFile> beside =
      {};  ///< read for values alone: other tasks, lists of frames and tools
  std::vector<std::string> not_read =
      {};  ///< what speaks of the robot and is not read: a sentence each
};

}  // namespace trammel::cli
