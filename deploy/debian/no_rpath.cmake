# Debian finds libtrammel in /usr/lib.
file(GLOB_RECURSE modules ${FOLDER}/*.so)
foreach(module ${modules})
  file(RPATH_REMOVE FILE ${module})
endforeach()
