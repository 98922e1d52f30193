MODULE Procedures
  PERS tooldata tSpindle:=[TRUE,[[100,0,150],[0.923879533,0,-0.382683432,0]],[100,[0,0,100],[1,0,0,0],0,0,0]];
  PERS wobjdata wPanel:=[FALSE,TRUE,"",[[1500,0,500],[1,0,0,0]],[[300,-250,300],[1,0,0,0]]];
  CONST robtarget pA:=[[0,140,390],[0.707107,0,0.707107,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget pB:=[[0,190,390],[0.707107,0,0.707107,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  PROC main()
    Drill pA\Depth:=12;
    Drill pB\Depth:=12;
    Approach pA,40;
  ENDPROC
  PROC Drill(robtarget p\num Depth)
    MoveL p,v40,fine,tSpindle\WObj:=wPanel;
  ENDPROC
  PROC Approach(robtarget p,num back)
    MoveL Offs(p,-back,0,0),v400,z20,tSpindle\WObj:=wPanel;
  ENDPROC
ENDMODULE
