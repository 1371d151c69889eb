# The component 'python': what the Python package holds beside its sources (pyproject.toml).
# A wheel has no symbolic links, so the library is one file, under the name that programs ask for.
set_target_properties(ovoid PROPERTIES VERSION ${OVOID_ABI} SOVERSION ${OVOID_ABI})
set_target_properties(ovoid_tool PROPERTIES INSTALL_RPATH "$ORIGIN/../lib")
install(TARGETS ovoid LIBRARY DESTINATION ovoid/lib COMPONENT python NAMELINK_SKIP)
install(TARGETS ovoid_tool RUNTIME DESTINATION ovoid/bin COMPONENT python)

# The OpenCL loader, for systems that have none; with its licence, or not at all.
get_filename_component(loader ${OpenCL_LIBRARY} REALPATH)
set(loader_licence /usr/share/doc/ocl-icd-libopencl1/copyright)
if(CMAKE_SYSTEM_NAME STREQUAL Linux AND EXISTS ${loader_licence})
  install(FILES ${loader} DESTINATION ovoid/loader COMPONENT python RENAME libOpenCL.so.1)
  install(FILES ${loader_licence} DESTINATION ovoid/loader COMPONENT python RENAME LICENSE)
endif()
