# SPDX-License-Identifier: BSD-3-Clause
"""The test that compares each name of the original with its figures; test_symbols.py reads it."""

_TESTS = {
    "test_data_set_packages.py::test_a_policy_has_a_configuration_and_acts": (
        "rlds.PolicyBase, rlds.PolicyConfig"
    ),
    "test_data_set_packages.py::test_data_sets_need_their_own_package": (
        "TriFingerDatasetEnv.get_dataset, rlds.TriFingerDatasetEnv, "
        "rrc_2022_datasets.TriFingerDatasetEnv"
    ),
    "test_data_set_packages.py::test_policies_are_found_by_their_names": (
        "rlds.evaluate_sim.load_policy_class"
    ),
    "test_data_set_packages.py::test_the_pose_of_a_box_follows_from_its_corners": (
        "rrc_2022_datasets.utils.get_pose_from_keypoints"
    ),
    "test_generations.py::test_an_environment_ends": "CE.CubeEnv, CE.FixedInitializer",
    "test_generations.py::test_calibration_files_survive": (
        "ts.camera.CameraParameters, ts.camera.load_camera_parameters"
    ),
    "test_generations.py::test_cameras_see_the_cube_where_their_calibration_says": (
        "CO.cameras[].image, P.enable_cameras, P.tricamera, ot.py_tricamera_types.CubeVisualizer"
    ),
    "test_generations.py::test_dice_are_found_by_their_colour": (
        "ot.py_lightblue_segmenter.segment_image"
    ),
    "test_generations.py::test_equal_seeds_give_equal_episodes": "CE.RandomInitializer",
    "test_generations.py::test_markers_take_all_spellings": (
        "Marker.set_state, vo.CubeMarker, vo.CuboidMarker, vo.Marker, vo.SphereMaker"
    ),
    "test_generations.py::test_objects_come_and_go_while_a_finger_moves": (
        "ts.collision_objects.Block"
    ),
    "test_generations.py::test_poses_of_a_simulated_object": (
        "ot.py_object_tracker.Data, ot.py_object_tracker.FakeBackend, "
        "ot.py_object_tracker.Frontend, "
        "ot.py_object_tracker.SimulationBackend, ot.py_object_tracker.get_model_by_name"
    ),
    "test_generations.py::test_random_positions_come_from_the_global_random": (
        "ts.sample.random_joint_positions"
    ),
    "test_generations.py::test_raw_images_become_colours": "cam.utils.convert_image",
    "test_generations.py::test_simple_cameras_have_the_size_that_was_asked_for": (
        "ts.camera.TriFingerCameras"
    ),
    "test_generations.py::test_the_simulation_of_2020_has_its_figures": "P.get_object_pose",
    "test_kinematics.py::test_each_type_has_a_file_with_its_tips": "SF.finger_urdf_path",
    "test_kinematics.py::test_inverse_kinematics_of_all_fingers": "K.inverse_kinematics",
    "test_kinematics.py::test_inverse_kinematics_of_one_finger_moves_no_other": (
        "K.inverse_kinematics_one_finger"
    ),
    "test_kinematics.py::test_old_names_are_the_same_class": "SF.pinocchio_utils",
    "test_kinematics.py::test_the_jacobian_of_a_finger_is_that_of_the_sheet": "K.compute_jacobian",
    "test_kinematics.py::test_tips_are_where_the_original_has_them": (
        "K.forward_kinematics, Kinematics(), SF.kinematics"
    ),
    "test_kinematics.py::test_types_of_robots": (
        "ftd.finger_types_data, ftd.get_finger_urdf, ftd.get_number_of_fingers, "
        "ftd.get_valid_finger_types"
    ),
    "test_logs.py::test_a_camera_log_is_read_and_written_as_the_sheet_describes_it": (
        "LogReader.data, cam.py_tricamera_types.LogReader, ot.py_tricamera_types.LogReader"
    ),
    "test_logs.py::test_a_recorded_run_becomes_files_that_a_platform_log_reads": (
        "PlatformLog.get_first_timeindex, PlatformLog.get_last_timeindex, "
        "rf.TriFingerPlatformLog, rf.TriFingerPlatformWithObjectFrontend, "
        "rf.TriFingerPlatformWithObjectLog, robot_fingers"
    ),
    "test_names.py::test_a_camera_sees_what_it_looks_at": "ts.camera.Camera",
    "test_names.py::test_actions_of_platform_and_finger_have_defaults": (
        "P.Action, P.get_time_step, P.simfinger, SF.Action, SF.time_step_s"
    ),
    "test_names.py::test_an_action_has_gains_that_are_not_numbers_unless_they_are_given": (
        "Action.position, Action.position_kd, Action.position_kp, Action.torque, ts.Action"
    ),
    "test_names.py::test_cameras_of_a_folder_can_get_company": (
        "CameraArray.cameras, ts.camera.create_trifinger_camera_array_from_config"
    ),
    "test_names.py::test_constants_of_the_tasks": (
        "mct.EPISODE_LENGTH, mct.FIRST_GOAL_DURATION, mct.GOAL_DIFFICULTY, mct.GOAL_DURATION, "
        "rd.EPISODE_LENGTH"
    ),
    "test_names.py::test_ids_of_links_are_those_of_the_original": (
        "SF.finger_id, SF.pybullet_joint_indices, SF.pybullet_link_indices, "
        "SF.pybullet_tip_link_indices"
    ),
    "test_names.py::test_matrices_of_opencv_are_arrays": "cam.camera.cvMat",
    "test_names.py::test_objects_are_chosen_by_their_numbers": "ObjectType.COLORED_CUBE",
    "test_names.py::test_observations_of_the_cameras_can_be_replaced": (
        "CO.cameras, CO.cameras[].timestamp, P._camera_observation_t, "
        "P._delayed_camera_observation, P._get_current_camera_observation"
    ),
    "test_names.py::test_positions_are_actions_too": "CE.ActionType.POSITION",
    "test_names.py::test_ranges_have_their_figures": (
        "L.n_fingers, S, P.spaces, S.robot_position, S.robot_torque.gym, S.robot_position.gym, "
        "S.robot_position.gym.low, S.robot_position.gym.high, S.robot_position.default, "
        "S.object_orientation.default, S.object_position.default, "
        "L.robot_torque.low, L.robot_torque.high, L.robot_torque.default, "
        "L.robot_position.low, L.robot_position.high, L.robot_position.default, "
        "L.robot_velocity.low, L.robot_velocity.high, "
        "L.object_position.low, L.object_position.high, "
        "L.object_orientation.low, L.object_orientation.high, L.object_orientation.default"
    ),
    "test_names.py::test_the_marker_of_a_fork_is_a_cube_marker": "vo.CubeMarker2",
    "test_names.py::test_types_of_actions_become_actions_of_the_robot": (
        "CE.ActionType.TORQUE, CE.ActionType.TORQUE_AND_POSITION"
    ),
    "test_names.py::test_types_of_goals_can_be_named": "mct.Position, mct.Trajectory, rd.Goal",
    "test_platform.py::test_25_dice_lie_on_the_table": "ObjectType.DICE",
    "test_platform.py::test_a_step_can_be_done_in_two_parts": (
        "SF._get_latest_observation, SF._set_desired_action, SF._step_simulation"
    ),
    "test_platform.py::test_actions_of_robot_interfaces_are_taken_and_come_back_as_such": (
        "robot_interfaces"
    ),
    "test_platform.py::test_all_types_of_robots_have_their_figures": (
        "SF.max_motor_torque, SF.number_of_fingers, SF.position_gains, SF.velocity_gains, "
        "ts.SimFinger"
    ),
    "test_platform.py::test_an_action_log_has_all_steps_with_the_original_types": (
        "P.store_action_log"
    ),
    "test_platform.py::test_an_appended_action_is_copied": "P.get_desired_action",
    "test_platform.py::test_an_observation_is_not_affected_by_the_action_of_its_step": (
        "P.get_applied_action, P.get_robot_observation, RO.torque"
    ),
    "test_platform.py::test_defaults_are_those_of_the_limits": (
        "CO.filtered_object_pose, ts.TriFingerPlatform"
    ),
    "test_platform.py::test_indices_count_from_0_and_only_the_newest_steps_can_be_read": (
        "P.append_desired_action, P.get_camera_observation, P.get_current_timeindex, "
        "P.get_timestamp_ms"
    ),
    "test_platform.py::test_observation_0_is_what_was_given_even_outside_of_the_arena": (
        "CO.object_pose"
    ),
    "test_platform.py::test_observations_are_arrays_that_do_not_change_later": (
        "RO.position, RO.tip_force, RO.velocity"
    ),
    "test_platform.py::test_platforms_are_independent_and_equal_ones_are_equal_bit_for_bit": (
        "SF._pybullet_client_id"
    ),
    "test_platform.py::test_the_applied_torque_follows_the_original_law": (
        "SF.append_desired_action"
    ),
    "test_platform.py::test_the_cube_can_be_moved_and_asked": "CollObj.get_state, P.cube",
    "test_platform.py::test_the_rate_of_images_can_change_and_follows_the_time_step": (
        "P.camera_rate_fps"
    ),
    "test_platform.py::test_the_state_of_a_finger_can_be_set_at_any_time": (
        "SF.get_observation, SF.reset_finger_positions_and_velocities"
    ),
    "test_platform.py::test_velocities_of_tips_follow_from_those_of_joints": (
        "P.forward_kinematics"
    ),
    "test_robots.py::test_a_front_end_has_the_rules_of_the_original": (
        "P.wait_until_time_index, P.wait_until_timeindex"
    ),
    "test_robots.py::test_a_logger_writes_what_a_reader_reads": (
        "Logger.start, ts.drivers.create_trifinger_backend"
    ),
    "test_robots.py::test_a_robot_of_a_program_takes_so_many_actions_and_no_more": (
        "Backend.wait_until_terminated, Frontend.append_desired_action, Frontend.get_observation"
    ),
    "test_robots.py::test_a_series_has_the_names_of_the_original": (
        "Frontend.wait_until_time_index, ri.finger, ts.drivers.create_single_finger_backend"
    ),
    "test_robots.py::test_actions_have_exactly_so_many_numbers": "ri.trifinger.Action",
    "test_robots.py::test_images_and_poses_of_a_robot_are_numbered": (
        "cam.tricamera.MultiProcessData, ot.py_tricamera_types.Frontend"
    ),
    "test_robots.py::test_a_program_takes_images_of_its_robot_and_keeps_them": (
        "cam.tricamera.Backend, cam.tricamera.PyBulletTriCameraDriver, "
        "ot.py_object_tracker.ObjectPose, ri.trifinger"
    ),
    "test_robots.py::test_the_first_name_gives_poses_too": "rf.TriFingerPlatformFrontend",
    "test_tasks_of_the_original.py::test_a_trajectory_has_ten_goals": (
        "mct.INITIAL_CUBE_POSITION, mct.evaluate_state, mct.get_active_goal, mct.sample_goal, "
        "mct.seed"
    ),
    "test_tasks_of_the_original.py::test_corners_of_a_turned_cube": "mc.get_cube_corner_positions",
    "test_tasks_of_the_original.py::test_equal_seeds_give_equal_layouts": "rd.sample_goal, rd.seed",
    "test_tasks_of_the_original.py::test_equal_seeds_give_the_goals_of_the_original": (
        "Goal.orientation, Goal.position, mc.random, mc.sample_goal"
    ),
    "test_tasks_of_the_original.py::test_figures_of_the_cube": (
        "mc._ARENA_RADIUS, mc._CUBE_WIDTH, mc._CUBOID_HALF_SIZE, mc._CUBOID_SIZE, "
        "mc._max_cube_com_distance_to_center, mc._max_height, mc._min_height, mc.episode_length"
    ),
    "test_tasks_of_the_original.py::test_goal_masks_show_the_dice_and_cost_counts_pixels": (
        "rd.evaluate_state, rd.generate_goal_mask"
    ),
    "test_tasks_of_the_original.py::test_goals_out_of_reach_are_errors_that_keep_the_pose": (
        "mc.InvalidGoalError, mc.validate_goal"
    ),
    "test_tasks_of_the_original.py::test_poses_keep_arrays_without_a_copy_and_go_through_json": (
        "Goal.to_dict, Goal.to_json, Pose.orientation, Pose.position, mc.Pose, "
        "mc.Pose.from_dict, mc.Pose.from_json"
    ),
    "test_tasks_of_the_original.py::test_the_cost_is_that_of_the_sheet": "mc.evaluate_state",
    "test_tasks_of_the_original.py::test_the_six_orientations_turn_their_faces_up": "mc._base_orientations",
    "test_tasks_of_the_original.py::test_wrong_layouts_are_errors": "rd.validate_goal",
    "test_tasks_of_the_original.py::test_wrong_trajectories_are_errors": "mct.validate_goal",
    "test_names.py::test_back_ends_refuse_configurations_of_the_original": (
        "rf.FingerConfig, rf.OneJointConfig, rf.SoloEightConfig, rf.TriFingerConfig, "
        "rf.TwoJointConfig, rf.create_real_finger_backend, rf.create_trifinger_backend"
    ),
    "test_names.py::test_what_cannot_be_served_says_what_to_use": (
        "cam.camera.OpenCVDriver, cam.camera.PylonDriver, cam.tricamera.TriCameraDriver, "
        "ot.py_object_tracker.CubeDetector, ot.py_tricamera_types.TriCameraObjectTrackerDriver, "
        "rf.create_one_joint_backend, rf.create_solo_eight_backend, rf.create_two_joint_backend, "
        "ts.collision_objects.import_mesh"
    ),
}

# name of the original -> "file::test"
TESTED: dict[str, str] = {
    name: test for test, names in _TESTS.items() for name in names.split(", ")
}
