MODULE ZhPart
  ! 左侧板 钻孔程序, 单位: 毫米 [1,2,3]
  PERS tooldata tSpindle:=[TRUE,[[100,0,150],[0.923879533,0,-0.382683432,0]],[100,[0,0,100],[1,0,0,0],0,0,0]];
  PERS wobjdata wPanel:=[FALSE,TRUE,"",[[1500,0,500],[1,0,0,0]],[[300,-250,300],[1,0,0,0]]];
  CONST robtarget p10:=[[-5.25,130.5,390.75],[0.707107,0,0.707107,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]; ! 第一孔 p10
  CONST robtarget p20:=[[-5.25,180.5,390.75],[0.707107,0,0.707107,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]; ! 第二孔
  PROC main()
    MoveL p10,v100,z5,tSpindle\WObj:=wPanel; ! 到位 (100%)
    MoveL p20,v100,fine,tSpindle\WObj:=wPanel;
  ENDPROC
ENDMODULE
