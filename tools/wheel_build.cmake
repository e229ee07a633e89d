# SPDX-License-Identifier: Apache-2.0

# What building interfaces against the `ros-jazzy-*` wheels wants beyond a plain build. A ROS installed by the
# system does not need this file. Use: cmake -DCMAKE_PROJECT_INCLUDE=<this file>

# The wheels export `<package>__rosidl_generator_py` targets that name the Python include folder of the machine
# that built the wheels, and CMake refuses a target with a missing folder. The generator finds this machine's
# Python headers by itself, so nothing is lost; where every folder exists, nothing changes.
function(drop_missing_include_folders)
  get_property(targets DIRECTORY PROPERTY IMPORTED_TARGETS)
  foreach(target IN LISTS targets)
    get_target_property(folders ${target} INTERFACE_INCLUDE_DIRECTORIES)
    if(NOT folders)
      continue()
    endif()
    set(existing "")
    foreach(folder IN LISTS folders)
      # A generator expression has no value before CMake generates: keep it.
      if(folder MATCHES "\\$<" OR EXISTS "${folder}")
        list(APPEND existing "${folder}")
      endif()
    endforeach()
    set_target_properties(${target} PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${existing}")
  endforeach()
endfunction()

# Every generated C++ file includes the same large headers: compiled as one file a library, leg_msgs builds in
# less than half the time. The generated C files define the same static names and cannot be joined.
function(join_generated_cpp_files)
  get_property(targets DIRECTORY PROPERTY BUILDSYSTEM_TARGETS)
  list(FILTER targets INCLUDE REGEX "__rosidl_typesupport_(cpp|introspection_cpp|fastrtps_cpp|fastrtps_c)$")
  foreach(target IN LISTS targets)
    set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 0)
  endforeach()
endfunction()

# The targets appear while the project's CMakeLists.txt runs: look at them when it has ended.
cmake_language(DEFER CALL drop_missing_include_folders)
cmake_language(DEFER CALL join_generated_cpp_files)
