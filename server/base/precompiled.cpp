// The one source of the shared precompiled header (see trammel_pch in CMakeLists.txt).
