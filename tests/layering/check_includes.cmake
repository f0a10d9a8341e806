# Reads the #include lines of all source folders and fails on one that docs/architecture.md forbids.
# cmake -DSOURCE_DIR=<repository> -P check_includes.cmake
cmake_minimum_required(VERSION 3.21)

# A folder may include itself and these.
set(uses_core "")
set(uses_scenegraph core)
set(uses_sampling core scenegraph)
set(uses_reconstruct core)
set(uses_raster core)
set(uses_raycast core scenegraph)
set(uses_render core scenegraph sampling reconstruct raster raycast)
set(uses_tools core scenegraph render)
set(folders core scenegraph sampling reconstruct raster raycast render tools)

# Each third-party library stays behind one door: a pattern of what is included, a pattern of the files that may.
set(libraries
  "^embree3/"          "^src/raycast/"
  "^GL/"               "^src/raster/"
  "^OpenImageIO/"      "^(src/core|scenegraph/io)/"
  "^(tbb|oneapi)/"     "^src/core/parallel\\.cpp$"
  "^(tiny_gltf|tiny_obj_loader|draco/|meshoptimizer|nanoflann|Eigen/|valijson/)" "^scenegraph/io/"
  "^nlohmann/"         "^(scenegraph/io|src/tools)/"
  "^CLI/"              "^src/tools/"
  "^(GLFW/|imgui|backends/)" "^src/tools/view_window\\.cpp$")

function(check_file folder path)
  file(STRINGS ${SOURCE_DIR}/${path} lines REGEX "^[ \t]*#[ \t]*include")
  foreach(line IN LISTS lines)
    if(NOT line MATCHES "include[ \t]*[<\"]([^>\"]+)[>\"]")
      continue()
    endif()
    set(included ${CMAKE_MATCH_1})
    string(REGEX MATCH "^[^/]+" target ${included})
    if(target IN_LIST folders AND NOT target STREQUAL folder AND NOT target IN_LIST uses_${folder})
      message(SEND_ERROR "${path} includes <${included}>: ${folder} must not use ${target}")
    endif()
    set(rules ${libraries})
    while(rules)
      list(POP_FRONT rules what where)
      if(included MATCHES "${what}" AND NOT path MATCHES "${where}")
        message(SEND_ERROR "${path} includes <${included}>: only files like ${where} may")
      endif()
    endwhile()
  endforeach()
endfunction()

set(count 0)
foreach(folder IN LISTS folders)
  foreach(place ${folder} src/${folder})
    file(GLOB_RECURSE files RELATIVE ${SOURCE_DIR} ${SOURCE_DIR}/${place}/*.h ${SOURCE_DIR}/${place}/*.cpp)
    foreach(path IN LISTS files)
      check_file(${folder} ${path})
      math(EXPR count "${count} + 1")
    endforeach()
  endforeach()
endforeach()
if(count EQUAL 0)
  message(SEND_ERROR "no source files below ${SOURCE_DIR}")
endif()
message(STATUS "${count} files checked")
